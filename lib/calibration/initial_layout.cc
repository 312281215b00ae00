// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/initial_layout.h"

#include <algorithm>

#include "calibration/disparity_factorisation.h"
#include "calibration/triangulation.h"

namespace lf {
namespace {

// Lens errors, rolled cameras and differences of depth among the cameras: 8 pixels of 400.
constexpr double kFactorThreshold = 0.02;
constexpr double kLeastFit = 0.3;

Quat small_turn(const Vec2& turn) {
  // The point straight ahead appears at `turn`: the camera looks the other way.
  const Vec3 axis(turn.y, -turn.x, 0);
  const double angle = glm::length(axis);
  return angle > 0 ? glm::angleAxis(angle, axis / angle) : Quat(1, 0, 0, 0);
}

}  // namespace

double layout_from_disparities(Reconstruction& scene, const Tracks& tracks) {
  const uint32_t lights = tracks.bar ? 2 : 1;
  std::vector<Sight> sights;
  for (const Observation& o : tracks.observations)
    if (const auto uv = scene.cameras[o.camera].lens().unproject(o.pixel))
      sights.push_back({o.camera, o.position * lights + o.light, *uv});
  const DisparityFactors factors =
      factorise_disparities(sights, tracks.cameras.size(), tracks.num_positions * lights, kFactorThreshold);
  for (size_t i = 0; i < scene.cameras.size(); i++) {
    const auto& factor = factors.cameras[i];
    CameraState& camera = scene.cameras[i];
    camera.used = factor.inliers > kLeastFit;
    if (camera.used) camera.set_pose({Vec3(factor.centre, 0), small_turn(factor.turn)});
  }
  targets_from_poses(scene, tracks, kFactorThreshold * scene.batch_mean[kF]);
  return factors.inliers;
}

void targets_from_poses(Reconstruction& scene, const Tracks& tracks, double threshold) {
  scene.targets.assign(tracks.num_positions, {});
  if (!tracks.bar) return triangulate_targets(scene, tracks, threshold);
  // How long is the bar in the scale of these poses?
  Tracks single = tracks;
  single.bar = false;
  single.num_positions = tracks.num_positions * 2;
  for (Observation& o : single.observations) o.position = o.position * 2 + o.light, o.light = 0;
  Reconstruction points = scene;
  points.targets.assign(single.num_positions, {});
  triangulate_targets(points, single, threshold);
  std::vector<double> lengths;
  for (size_t j = 0; j < tracks.num_positions; j++)
    if (points.targets[2 * j].has(0) && points.targets[2 * j + 1].has(0))
      lengths.push_back(glm::length(points.targets[2 * j].point(0) - points.targets[2 * j + 1].point(0)));
  if (lengths.empty()) return;
  std::nth_element(lengths.begin(), lengths.begin() + lengths.size() / 2, lengths.end());
  const double length = lengths[lengths.size() / 2];
  for (CameraState& camera : scene.cameras)
    for (int i = 4; i < 7; i++) camera.v[i] /= length;
  triangulate_targets(scene, tracks, threshold);
}

}  // namespace lf
