// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/triangulation.h"

#include <algorithm>
#include <random>

namespace lf {
namespace {

constexpr int kPointSamples = 30;
constexpr int kPointRounds = 6;

struct Ray {
  const CameraState* camera;
  const Observation* observation;
  Vec3 origin, direction;
  double f;
};

// Where two rays pass each other; nothing where they are parallel or do so behind a camera.
std::optional<Vec3> meet(const Ray& a, const Ray& b) {
  const Vec3 w = b.origin - a.origin;
  const double d = glm::dot(a.direction, b.direction), det = 1 - d * d;
  if (!(det > 1e-14)) return std::nullopt;
  const double wa = glm::dot(w, a.direction), wb = glm::dot(w, b.direction);
  const double s = (wa - d * wb) / det, t = (d * wa - wb) / det;
  if (!(s > 0 && t > 0)) return std::nullopt;
  return (a.origin + a.direction * s + b.origin + b.direction * t) / 2.0;
}

double error_of(const Ray& ray, const Vec3& point) {
  TargetState target;
  target.kind = TargetState::Kind::kPoint;
  for (int i = 0; i < 3; i++) target.v[i] = point[i];
  const auto e = residual(*ray.camera, target, *ray.observation);
  return e ? glm::length(*e) : 1e9;
}

double agreement(const std::vector<Ray>& rays, const Vec3& point, double threshold) {
  double sum = 0;
  for (const Ray& ray : rays) {
    const double e = error_of(ray, point) / threshold;
    sum += std::max(0.0, 1 - e * e);
  }
  return sum;
}

// The point nearest to all rays in angle, reweighted: what is far off counts nothing.
Vec3 refine(const std::vector<Ray>& rays, Vec3 point, double threshold) {
  for (int round = 0; round < kPointRounds; round++) {
    Mat3 a(0.0);
    Vec3 b(0.0);
    for (const Ray& ray : rays) {
      const double e = error_of(ray, point) / threshold, depth = glm::dot(point - ray.origin, ray.direction);
      if (!(depth > 0)) continue;
      const double robust = 1 / (1 + e * e), w = robust * robust * ray.f * ray.f / (depth * depth);
      const Mat3 across = Mat3(1.0) - glm::outerProduct(ray.direction, ray.direction);
      a += w * across;
      b += w * (across * (ray.origin - point));
    }
    if (!(std::abs(glm::determinant(a)) > 0)) break;
    const Vec3 step = glm::inverse(a) * b;
    if (!is_finite(step)) break;
    point += step;
  }
  return point;
}

}  // namespace

std::vector<std::vector<uint32_t>> observations_of_positions(const Tracks& tracks) {
  std::vector<std::vector<uint32_t>> lists(tracks.num_positions);
  for (uint32_t i = 0; i < tracks.observations.size(); i++) lists[tracks.observations[i].position].push_back(i);
  return lists;
}

std::vector<std::vector<uint32_t>> observations_of_cameras(const Tracks& tracks) {
  std::vector<std::vector<uint32_t>> lists(tracks.cameras.size());
  for (uint32_t i = 0; i < tracks.observations.size(); i++) lists[tracks.observations[i].camera].push_back(i);
  return lists;
}

std::optional<Triangulated> triangulate(const std::vector<CameraState>& cameras, const Tracks& tracks,
                                        const std::vector<uint32_t>& observations, double threshold) {
  std::vector<Ray> rays;
  for (const uint32_t index : observations) {
    const Observation& o = tracks.observations[index];
    const CameraState& camera = cameras[o.camera];
    if (!camera.used) continue;
    const auto uv = camera.lens().unproject(o.pixel);
    if (!uv) continue;
    const Pose pose = camera.pose();
    rays.push_back({&camera, &o, pose.position, pose.rotation() * glm::normalize(Vec3(*uv, 1)), camera.v[7]});
  }
  if (rays.size() < 2) return std::nullopt;
  std::mt19937 random(1);
  const size_t pairs = rays.size() * (rays.size() - 1) / 2;
  Triangulated best;
  const auto attempt = [&](size_t i, size_t j) {
    const auto point = meet(rays[i], rays[j]);
    if (!point) return;
    const double score = agreement(rays, *point, threshold);
    if (score > best.agreement) best = {*point, score};
  };
  if (pairs <= kPointSamples)
    for (size_t i = 0; i < rays.size(); i++)
      for (size_t j = 0; j < i; j++) attempt(i, j);
  else
    for (int sample = 0; sample < kPointSamples; sample++) {
      const size_t i = random() % rays.size(), j = random() % rays.size();
      if (i != j) attempt(i, j);
    }
  if (best.agreement < 1) return std::nullopt;
  const Vec3 refined = refine(rays, best.point, threshold);
  const double score = agreement(rays, refined, threshold);
  if (score > best.agreement) best = {refined, score};
  return best;
}

void triangulate_targets(Reconstruction& scene, const Tracks& tracks, double threshold) {
  const auto lists = observations_of_positions(tracks);
  for (size_t j = 0; j < lists.size(); j++) {
    std::optional<Triangulated> found[2];
    double now = 0;
    for (uint32_t light = 0; light < (tracks.bar ? 2u : 1u); light++) {
      std::vector<uint32_t> list;
      for (const uint32_t index : lists[j]) {
        const Observation& o = tracks.observations[index];
        if (o.light != light || !scene.cameras[o.camera].used) continue;
        list.push_back(index);
        if (!scene.targets[j].has(light)) continue;
        const auto e = residual(scene.cameras[o.camera], scene.targets[j], o);
        if (e) now += std::max(0.0, 1 - glm::dot(*e, *e) / (threshold * threshold));
      }
      found[light] = triangulate(scene.cameras, tracks, list, threshold);
    }
    const double then = (found[0] ? found[0]->agreement : 0) + (found[1] ? found[1]->agreement : 0);
    if (then <= now) continue;
    TargetState& target = scene.targets[j];
    const bool bar = found[0] && found[1];
    target.kind = bar ? TargetState::Kind::kBar : TargetState::Kind::kPoint;
    target.light = found[0] ? 0 : 1;
    const Vec3 first = found[target.light]->point, second = bar ? found[1]->point : first;
    const Vec3 middle = (first + second) / 2.0, along = second - first;
    const double length = glm::length(along);
    for (int i = 0; i < 3; i++) {
      target.v[i] = middle[i];
      target.v[3 + i] = length > 0 ? along[i] / length : (i == 0);
    }
  }
}

}  // namespace lf
