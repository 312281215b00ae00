// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>

#include <opencv2/calib3d.hpp>

#include "calibration/initial_layout.h"
#include "calibration/triangulation.h"

namespace lf {
namespace {

constexpr size_t kLeastShared = 12;
constexpr size_t kPairsTried = 20;
constexpr double kWideEnough = 0.3;  // radians between lines of sight; more does not make a better pair

struct Shared {
  size_t a, b;
  std::vector<cv::Point2d> in_a, in_b;  // normalised
};

std::vector<Shared> pairs_by_overlap(const Scene& scene, const Tracks& tracks) {
  const uint32_t lights = tracks.bar ? 2 : 1;
  std::vector<std::vector<std::optional<Vec2>>> uv(tracks.cameras.size(),
                                                   std::vector<std::optional<Vec2>>(tracks.num_positions * lights));
  for (const Observation& o : tracks.observations)
    uv[o.camera][o.position * lights + o.light] = scene.cameras[o.camera].lens().unproject(o.pixel);
  std::vector<Shared> pairs;
  for (size_t a = 0; a < uv.size(); a++)
    for (size_t b = 0; b < a; b++) {
      Shared pair{a, b, {}, {}};
      for (size_t j = 0; j < uv[a].size(); j++)
        if (uv[a][j] && uv[b][j]) {
          pair.in_a.emplace_back(uv[a][j]->x, uv[a][j]->y);
          pair.in_b.emplace_back(uv[b][j]->x, uv[b][j]->y);
        }
      if (pair.in_a.size() >= kLeastShared) pairs.push_back(std::move(pair));
    }
  std::sort(pairs.begin(), pairs.end(), [](const auto& x, const auto& y) { return x.in_a.size() > y.in_a.size(); });
  if (pairs.size() > kPairsTried) pairs.resize(kPairsTried);
  return pairs;
}

// The pose of b where a is at the origin, one unit away; `score` counts the points that fit, more where sights cross
// at a wide angle.
std::optional<Pose> pose_of_pair(const Shared& pair, double reach, double& score) {
  cv::Mat fit, rotation, shift;
  const cv::Mat k = cv::Mat::eye(3, 3, CV_64F);
  cv::Mat essential = cv::findEssentialMat(pair.in_a, pair.in_b, k, cv::RANSAC, 0.999, reach, fit);
  if (essential.rows < 3) return std::nullopt;
  essential = essential.rowRange(0, 3).clone();
  const int inliers = cv::recoverPose(essential, pair.in_a, pair.in_b, k, rotation, shift, fit);
  if (inliers < static_cast<int>(kLeastShared) / 2) return std::nullopt;
  Mat3 world_from_b;
  for (int row = 0; row < 3; row++)
    for (int column = 0; column < 3; column++) world_from_b[row][column] = rotation.at<double>(row, column);
  const Vec3 t(shift.at<double>(0), shift.at<double>(1), shift.at<double>(2));
  std::vector<double> angles;
  for (size_t j = 0; j < pair.in_a.size(); j++)
    if (fit.at<uchar>(static_cast<int>(j)))
      angles.push_back(
          std::acos(std::clamp(glm::dot(glm::normalize(Vec3(pair.in_a[j].x, pair.in_a[j].y, 1)),
                                        glm::normalize(world_from_b * Vec3(pair.in_b[j].x, pair.in_b[j].y, 1))),
                               -1.0, 1.0)));
  std::nth_element(angles.begin(), angles.begin() + angles.size() / 2, angles.end());
  score = inliers * std::min(angles[angles.size() / 2], kWideEnough);
  return Pose{-(world_from_b * t), glm::quat_cast(world_from_b)};
}

}  // namespace

int layout_from_pairs(Scene& scene, const Tracks& tracks, double threshold) {
  cv::setRNGSeed(1);
  for (CameraState& camera : scene.cameras) camera.used = false;
  scene.targets.assign(tracks.num_positions, {});
  double best = 0;
  Pose pose;
  size_t first = 0, second = 0;
  for (const Shared& pair : pairs_by_overlap(scene, tracks)) {
    double score = 0;
    const auto found = pose_of_pair(pair, threshold / scene.cameras[pair.a].lens_terms()[kF], score);
    if (found && score > best) best = score, pose = *found, first = pair.a, second = pair.b;
  }
  if (best == 0) return 0;
  scene.cameras[first].set_pose({});
  scene.cameras[second].set_pose(pose);
  scene.cameras[first].used = scene.cameras[second].used = true;
  Tracks single = tracks;  // each end of a bar a point of its own: there is no scale yet
  if (tracks.bar) {
    single.bar = false;
    single.num_positions *= 2;
    for (Observation& o : single.observations) o.position = o.position * 2 + o.light, o.light = 0;
  }
  scene.targets.assign(single.num_positions, {});
  int placed = 2;
  for (int more = 1; more > 0; placed += more) {
    triangulate_targets(scene, single, threshold);
    AdjustmentOptions settle;
    settle.robust = 2, settle.sigma = threshold / 4, settle.max_iterations = 6, settle.tolerance = 1e-3;
    adjust(scene, single.observations, Inliers(single.observations.size(), true), settle);
    more = resect_cameras(scene, single, 2 * threshold);
  }
  targets_from_poses(scene, tracks, threshold);
  return placed;
}

}  // namespace lf
