// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/array.h"

#include <cmath>
#include <cstdint>
#include <random>

#include "rig/rig.h"
#include "scene/scene.h"

namespace lf::bench {
namespace {

// Width, in metres, of the area in the array's plane that a view's lines of sight cover; the height follows from the
// aspect ratio.
constexpr double kExtent = 0.27;
// Extent of the array beyond that area, in pitches: the outer cameras are off by up to 5 %.
constexpr double kMargin = 0.15;
constexpr double kCameraFov = 60, kViewFov = 55;  // degrees, vertical
constexpr double kFocus = kSceneMiddle;           // metres in front of the array

int rows_of(int cameras) {
  int rows = 1;
  for (int r = 2; r * r <= cameras; r++)
    if (cameras % r == 0) rows = r;
  return rows;
}

// Pitch in metres, such that `n` cameras exceed `extent` by the margin on each side.
double pitch_of(double extent, int n) { return extent / std::max(n - 1 - 2 * kMargin, 0.5); }

}  // namespace

Rig make_array(const ArrayOptions& options) {
  const int rows = rows_of(options.cameras), columns = options.cameras / rows;
  Rig rig = make_grid_rig({rows, columns, 1, kCameraFov, options.width, options.height});
  const double shape = static_cast<double>(options.height) / options.width;
  const Vec3 pitch(pitch_of(kExtent, columns), pitch_of(kExtent * shape, rows), 0);
  std::mt19937_64 engine(1);
  const auto random = [&](double most) { return most * (2 * static_cast<double>(engine() >> 11) * 0x1p-53 - 1); };
  for (Camera& camera : rig.cameras) {
    camera.pose.position = camera.pose.position * pitch + Vec3(random(0.05), random(0.05), 0) * pitch;
    camera.pose.position.z = random(0.05) * pitch.x;
    const double half = 1 * M_PI / 180 / 2;
    const double x = random(half), y = random(half), z = random(half);
    camera.pose.orientation = glm::normalize(Quat(1, x, y, z));
    const double f = camera.lens.fx() * (1 + random(0.02));
    const double k1 = options.distortion ? -0.15 : 0, k2 = options.distortion ? 0.03 : 0;
    camera.lens = Lens(LensModel::kRadial, {f, camera.lens.cx(), camera.lens.cy(), k1, k2});
  }
  return rig;
}

View make_view(int width, int height, int n) {
  View view;
  view.width = width;
  view.height = height;
  view.lens = Lens::from_fov_y(kViewFov, width, height);
  // The covered area grows with the distance from the array: from this distance the view covers the whole array.
  const double half_width = std::tan(kViewFov / 2 * M_PI / 180) * width / height;
  view.pose.position = {0, 0, kExtent / 2 / half_width * (1 - 0.06 * n)};
  const double depths[] = {kFocus, kSceneNear, kSceneFar};
  view.focus.plane = plane_through({0, 0, depths[n % 3]}, {0, 0, -1});
  return view;
}

}  // namespace lf::bench
