// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/relative_poses.h"

#include <algorithm>

#include <opencv2/calib3d.hpp>

namespace lf {
namespace {

constexpr size_t kLeastShared = 12;
constexpr size_t kPartners = 6;
constexpr double kWideEnough = 0.3;  // radians between lines of sight; more does not make a better pair

struct Shared {
  size_t a, b;
  std::vector<cv::Point2d> in_a, in_b;  // normalised
};

std::vector<Shared> pairs_that_share_most(const Scene& scene, const Tracks& tracks) {
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
  // The best partners of each.
  std::sort(pairs.begin(), pairs.end(), [](const auto& x, const auto& y) { return x.in_a.size() > y.in_a.size(); });
  std::vector<size_t> partners(tracks.cameras.size());
  std::erase_if(pairs, [&](const Shared& pair) {
    if (partners[pair.a] >= kPartners && partners[pair.b] >= kPartners) return true;
    partners[pair.a]++, partners[pair.b]++;
    return false;
  });
  return pairs;
}

// The pose of b where a is at the origin, one unit away; `score` counts the points that fit, more where sights cross
// at a wide angle.
std::optional<Pose> pose_of_pair(const Shared& pair, double reach, double& score) {
  cv::Mat fit, rotation, shift;
  const cv::Mat k = cv::Mat::eye(3, 3, CV_64F);
  cv::Mat essential = cv::findEssentialMat(pair.in_a, pair.in_b, k, cv::USAC_MAGSAC, 0.999, reach, fit);
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

std::vector<RelativePose> relative_poses(const Scene& scene, const Tracks& tracks, double threshold) {
  cv::setRNGSeed(1);
  std::vector<RelativePose> poses;
  for (const Shared& pair : pairs_that_share_most(scene, tracks)) {
    RelativePose relative{pair.a, pair.b};
    const auto found = pose_of_pair(pair, threshold / scene.cameras[pair.a].lens_terms()[kF], relative.score);
    if (!found) continue;
    relative.a_from_b = *found;
    poses.push_back(relative);
  }
  return poses;
}

}  // namespace lf
