// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/grid_rig.h"

#include <cstdio>

#include "base/error.h"

namespace lf {

Rig make_grid_rig(const GridRigOptions& options) {
  const auto require_range = [](const char* what, int value, int most) {
    if (value < 1 || value > most)
      throw Error(std::string(what) + ": must be 1 to " + std::to_string(most) + ", is " + std::to_string(value));
  };
  require_range("rows", options.rows, kMaxCameras);
  require_range("columns", options.columns, kMaxCameras);
  if (static_cast<int64_t>(options.rows) * options.columns > kMaxCameras)
    throw Error("rows x columns: at most " + std::to_string(kMaxCameras) + " cameras");
  require_range("width", options.width, kMaxImageSize);
  require_range("height", options.height, kMaxImageSize);
  if (!(options.pitch > 0 && is_finite(options.pitch))) throw Error("pitch: must be positive");
  const Lens pinhole = Lens::from_fov_y(options.fov_y_deg, options.width, options.height);
  const Lens lens(LensModel::kRadial, {pinhole.fx(), pinhole.cx(), pinhole.cy(), 0, 0});

  Rig rig;
  rig.topology = {Topology::Type::kGrid, options.rows, options.columns, {}};
  for (int row = 0; row < options.rows; row++)
    for (int column = 0; column < options.columns; column++) {
      char name[40];
      std::snprintf(name, sizeof(name), "cam_%02d_%02d", row, column);
      Camera camera;
      camera.id = static_cast<uint32_t>(rig.cameras.size());
      camera.name = name;
      camera.width = options.width;
      camera.height = options.height;
      camera.lens = lens;
      camera.pose.position =
          Vec3(column - (options.columns - 1) / 2.0, row - (options.rows - 1) / 2.0, 0) * options.pitch;
      rig.cameras.push_back(camera);
    }
  return rig;
}

}  // namespace lf
