// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/reprojection.h"

#include <algorithm>
#include <limits>

namespace lf {
namespace {

constexpr int kSteps = 8;
constexpr double kNever = std::numeric_limits<double>::infinity();

// At the pixel where `a` sees direction (u, v, 1), `distance` metres along the axis; infinity: the direction alone.
double error_at(const Camera& a, const Camera& b, const Vec2& pixel, const Vec2& uv, double distance) {
  const Mat3 b_from_a = glm::transpose(b.pose.rotation()) * a.pose.rotation();
  Vec3 x = b_from_a * Vec3(uv, 1);
  if (distance < kNever)  // differences of positions first: nothing is lost far from the origin
    x = x * distance + glm::transpose(b.pose.rotation()) * (a.pose.position - b.pose.position);
  const std::optional<Vec2> seen = b.lens.project(x);
  return seen ? glm::length(*seen - pixel) : kNever;
}

}  // namespace

double max_reprojection_error(const Rig& a, const Rig& b, double distance) {
  if (a.cameras.size() != b.cameras.size()) return kNever;
  double worst = 0;
  for (size_t i = 0; i < a.cameras.size(); i++) {
    const Camera& camera = a.cameras[i];
    for (int n = 0; n < (kSteps + 1) * (kSteps + 1); n++) {
      const Vec2 pixel(camera.width * (n % (kSteps + 1)) / double{kSteps} - 0.5,
                       camera.height * (n / (kSteps + 1)) / double{kSteps} - 0.5);
      const std::optional<Vec2> uv = camera.lens.unproject(pixel);
      if (!uv) continue;  // no ray of `a` ends there
      for (const double d : {distance, kNever}) worst = std::max(worst, error_at(camera, b.cameras[i], pixel, *uv, d));
    }
  }
  return worst;
}

}  // namespace lf
