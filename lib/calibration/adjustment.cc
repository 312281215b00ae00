// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/adjustment.h"

#include "calibration/projection.h"

namespace lf {

void CameraState::set_pose(const Pose& pose) {
  const Quat q = glm::normalize(pose.orientation);
  v[0] = q.w, v[1] = q.x, v[2] = q.y, v[3] = q.z;
  for (int i = 0; i < 3; i++) v[4 + i] = pose.position[i];
}

Lens CameraState::lens() const {
  const double* t = lens_terms();
  if (aspect == 1 && p1 == 0 && p2 == 0) return Lens(LensModel::kRadial, {t[kF], t[kCx], t[kCy], t[kK1], t[kK2]});
  return Lens(LensModel::kOpenCv, {t[kF], t[kF] * aspect, t[kCx], t[kCy], t[kK1], t[kK2], p1, p2});
}

void CameraState::set_lens(const Lens& lens) {
  aspect = lens.fy() / lens.fx();
  p1 = lens.p1(), p2 = lens.p2();
  double* t = lens_terms();
  t[kF] = lens.fx(), t[kCx] = lens.cx(), t[kCy] = lens.cy(), t[kK1] = lens.k1(), t[kK2] = lens.k2();
}

Vec3 TargetState::point(uint32_t which) const {
  if (kind != Kind::kBar) return {v[0], v[1], v[2]};
  double p[3];
  projection::bar_end(v.data(), which, p);
  return {p[0], p[1], p[2]};
}

bool Scene::measured(int term) const {
  for (size_t i = 0; i < lens_priors.size(); i++)
    if (measured(i, term)) return true;
  return false;
}

std::optional<Vec2> residual(const CameraState& camera, const TargetState& target, const Observation& observation) {
  const Vec3 point = target.point(observation.light);
  double pixel[2];
  if (!projection::project(camera.v.data(), camera.aspect, camera.p1, camera.p2, &point.x, pixel)) return std::nullopt;
  return Vec2(pixel[0], pixel[1]) - observation.pixel;
}

}  // namespace lf
