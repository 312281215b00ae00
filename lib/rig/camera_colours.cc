// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/camera_colours.h"

namespace lf {

CameraColours::CameraColours(const Rig& rig) {
  if (!rig.has_colour()) return;
  for (const Camera& camera : rig.cameras) {
    cameras_.push_back(nullptr);
    if (!camera.colour || *camera.colour == ColourModel()) continue;
    cameras_.back() = std::make_unique<OfCamera>();
    cameras_.back()->model = *camera.colour;
    cameras_.back()->width = camera.width;
    cameras_.back()->height = camera.height;
    cameras_.back()->centre = camera.principal_point();
  }
}

const ColourCorrection* CameraColours::of(CameraIndex camera, PixelFamily family) const {
  if (camera >= cameras_.size() || !cameras_[camera]) return nullptr;
  OfCamera& found = *cameras_[camera];
  const size_t i = family == PixelFamily::kRgb ? 0 : 1;
  std::call_once(found.made[i], [&] {
    found.correction[i] =
        std::make_unique<const ColourCorrection>(found.model, family, found.width, found.height, found.centre);
  });
  return found.correction[i].get();
}

}  // namespace lf
