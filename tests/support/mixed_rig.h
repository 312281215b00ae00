// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "rig/rig.h"

namespace lf {

// A camera of every model, pointing every way.
inline Rig mixed_rig() {
  using enum LensModel;
  const Lens lenses[] = {Lens(kSimplePinhole, {400, 159.5, 119.5}), Lens(kPinhole, {400, 410, 160, 118}),
                         Lens(kSimpleRadial, {400, 159.5, 119.5, -0.1}),
                         Lens(kRadial, {386.73880838315351, 159.5, 119.5, -0.15, 0.03}),
                         Lens(kOpenCv, {400, 410, 160, 118, -0.15, 0.03, 1e-3, -2e-3})};
  Rig rig;
  for (const Lens& lens : lenses) {
    Camera camera;
    const double i = static_cast<double>(rig.cameras.size());
    camera.id = 20 - static_cast<uint32_t>(rig.cameras.size());
    camera.name = "cam_" + std::to_string(rig.cameras.size());
    camera.image = camera.name + ".png";
    camera.width = 320;
    camera.height = 240;
    camera.lens = lens;
    camera.pose = {{57.1 + i / 3, -23.4 * i, 1 / (i + 3)}, glm::normalize(Quat(0.3 - i / 4, 0.2, -0.5, 0.1 * i))};
    rig.cameras.push_back(camera);
  }
  return rig;
}

}  // namespace lf
