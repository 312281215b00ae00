// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/array_shapes.h"

#include <cmath>
#include <cstdio>
#include <numbers>

#include "base/error.h"

namespace lf {
namespace {

void require_length(const char* what, double value) {
  if (!(value > 0 && is_finite(value))) throw Error(std::string(what) + ": must be positive");
}

// A row of cameras in one place each, with lens, size, id and name; `place` says where the i-th stands and looks.
template <typename Place>
Rig row_of(int cameras, double fov_y_deg, int width, int height, Place place) {
  Rig rig = make_grid_rig({1, cameras, 1, fov_y_deg, width, height});
  for (int i = 0; i < cameras; i++) {
    Camera& camera = rig.cameras[static_cast<size_t>(i)];
    char name[20];
    std::snprintf(name, sizeof(name), "cam_%02d", i);
    camera.name = name;
    camera.pose = place(i);
  }
  return rig;
}

}  // namespace

Rig make_arc_rig(const ArcRigOptions& options) {
  require_length("pitch", options.pitch);
  require_length("radius", options.radius);
  const double step = 2 * std::asin(std::min(1.0, options.pitch / (2 * options.radius)));
  if (step * (options.cameras - 1) >= std::numbers::pi || options.pitch > 2 * options.radius)
    throw Error("radius: " + std::to_string(options.cameras) +
                " cameras at this pitch go around half the circle or more; make several rigs of them");
  return row_of(options.cameras, options.fov_y_deg, options.width, options.height, [&](int i) {
    const double angle = step * (i - (options.cameras - 1) / 2.0);  // to the right
    Pose pose;
    pose.position = options.radius * Vec3(std::sin(angle), 0, 1 - std::cos(angle));
    pose.orientation = Quat(std::cos(angle / 2), 0, -std::sin(angle / 2), 0);
    return pose;
  });
}

Rig make_ring_rig(const RingRigOptions& options) {
  require_length("radius", options.radius);
  if (options.cameras < 3) throw Error("ring: at least 3 cameras, has " + std::to_string(options.cameras));
  Rig rig = row_of(options.cameras, options.fov_y_deg, options.width, options.height, [&](int i) {
    const double angle = 2 * std::numbers::pi * i / options.cameras;
    Pose pose;
    pose.position = options.radius * Vec3(std::sin(angle), -std::cos(angle), 0);
    return pose;
  });
  rig.topology = {};
  return rig;
}

Rig make_cylinder_rig(const CylinderRigOptions& options) {
  require_length("pitch", options.pitch);
  require_length("radius", options.radius);
  if (options.rows < 2) throw Error("rows: around a cylinder at least 2, has " + std::to_string(options.rows));
  if (options.columns < 3) throw Error("columns: around a cylinder at least 3, has " + std::to_string(options.columns));
  Rig rig =
      make_grid_rig({options.rows, options.columns, options.pitch, options.fov_y_deg, options.width, options.height});
  const double side = options.inward ? -1 : 1;
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    const double angle = 2 * std::numbers::pi * static_cast<double>(i % options.columns) / options.columns;
    Pose& pose = rig.cameras[i].pose;
    pose.position.x = options.radius * std::sin(angle);
    pose.position.z = options.radius * (side * std::cos(angle) + (options.inward ? 1 : 0));
    pose.orientation = Quat(std::cos(angle / 2), 0, side * std::sin(angle / 2), 0);
  }
  rig.topology = {.type = Topology::Type::kTriangles};
  const CameraIndex columns = static_cast<CameraIndex>(options.columns);
  for (CameraIndex row = 0; row + 1 < static_cast<CameraIndex>(options.rows); row++)
    for (CameraIndex column = 0; column < columns; column++) {
      const CameraIndex a = row * columns + column, b = row * columns + (column + 1) % columns;
      rig.topology.triangles.push_back({a, b, a + columns});
      rig.topology.triangles.push_back({b, b + columns, a + columns});
    }
  return rig;
}

}  // namespace lf
