// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/adjustment.h"

#include <Eigen/Geometry>

#include "base/error.h"
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

bool Reconstruction::measured(int term) const {
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

double spread(const std::vector<Vec3>& points) {
  Vec3 mean(0, 0, 0);
  for (const Vec3& p : points) mean += p;
  mean /= static_cast<double>(points.size());
  double sum = 0;
  for (const Vec3& p : points) sum += glm::dot(p - mean, p - mean);
  return std::sqrt(sum / static_cast<double>(points.size()));
}

Similarity align(const std::vector<Pose>& a, const std::vector<Pose>& b, bool fixed_scale) {
  if (a.size() != b.size() || a.size() < 2) throw Error("alignment needs two cameras at least");
  // Each camera is its centre and, near it, the ends of its axes. Relative to the first: nothing is lost far away.
  const auto points = [](const std::vector<Pose>& poses, double reach) {
    Eigen::Matrix3Xd m(3, 4 * poses.size());
    for (size_t i = 0; i < poses.size(); i++) {
      const Mat3 axes = poses[i].rotation();
      for (int k = 0; k < 4; k++) {
        const Vec3 p = poses[i].position - poses[0].position + (k < 3 ? axes[k] * reach : Vec3(0, 0, 0));
        m.col(static_cast<Eigen::Index>(4 * i + k)) << p.x, p.y, p.z;
      }
    }
    return m;
  };
  const auto spread_of = [](const std::vector<Pose>& poses) {
    std::vector<Vec3> centres;
    for (const Pose& pose : poses) centres.push_back(pose.position - poses[0].position);
    return spread(centres);
  };
  const double size_a = spread_of(a), size_b = spread_of(b);
  if (!(size_a > 0 && size_b > 0)) throw Error("cameras at one place have no scale to be aligned by");
  const Eigen::Matrix4d t = Eigen::umeyama(points(a, kTurnWeight * size_a),
                                           points(b, kTurnWeight * (fixed_scale ? size_a : size_b)), !fixed_scale);
  Similarity s;
  const Eigen::Matrix3d m = t.topLeftCorner<3, 3>();
  s.scale = fixed_scale ? 1 : std::cbrt(m.determinant());
  const Eigen::Quaterniond q(Eigen::Matrix3d(m / s.scale));
  s.rotation = glm::normalize(Quat(q.w(), q.x(), q.y(), q.z()));
  const Vec3 shift(t(0, 3), t(1, 3), t(2, 3));
  s.translation = shift + b[0].position - s.scale * (s.rotation * a[0].position);
  return s;
}

}  // namespace lf
