// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/halves.h"

#include <cmath>

#include <Eigen/Cholesky>

#include "calibration/adjustment.h"
#include "calibration/triangulation.h"
#include "calibration/uncertainty.h"

namespace lf {
namespace {

constexpr int kBlocks = 8;      // across an image, or along the path of a light
constexpr int kSplits = 2;      // few modes are soft: one split would judge them by one number each
constexpr int kIterations = 8;  // from the solution of all
using Eigen::VectorXd;

// 0 or 1 for each position. The second split has its borders amid the first one's halves.
std::vector<char> sides(const Tracks& tracks, const std::vector<std::vector<uint32_t>>& positions, int split) {
  std::vector<char> side(positions.size());
  for (size_t j = 0; j < positions.size(); j++) {
    if (tracks.ordered) {
      side[j] = static_cast<char>((2 * kBlocks * j / positions.size() + static_cast<size_t>(split)) / 2 & 1);
    } else if (!positions[j].empty()) {
      const Observation& first = tracks.observations[positions[j][0]];
      const double block = static_cast<double>(tracks.cameras[first.camera].width) / kBlocks;
      const Vec2 at = first.pixel / block + Vec2(0.5, 0.5) * static_cast<double>(split) + Vec2(1, 1);
      side[j] = static_cast<char>((static_cast<int>(at.x) + static_cast<int>(at.y)) & 1);
    }
  }
  return side;
}

struct Half {
  std::vector<CameraState> cameras;  // aligned with the whole
  VectorXd variance;                 // of their steps, from the observations: both halves have the priors
};

Half solve_half(const Reconstruction& whole, const Tracks& tracks, const Inliers& use, AdjustmentOptions options) {
  const Uncertainty u = estimate_uncertainty(whole, tracks.observations, use, options);
  Half half{whole.cameras, u.covariance.diagonal()};
  const auto lens = static_cast<Eigen::Index>(u.lens_terms.size());
  if (lens > 0) {
    Eigen::MatrixXd by_lens(u.covariance.rows(), u.prior_covariance.rows());
    Eigen::Index column = 0;
    for (const int row : u.camera_row) {
      if (row < 0) continue;
      by_lens.middleCols(column, lens) = u.covariance.middleCols(row + 6, lens);
      column += lens;
    }
    const Eigen::MatrixXd prior = u.prior_covariance.llt().solve(by_lens.transpose());
    half.variance -= by_lens.cwiseProduct(prior.transpose()).rowwise().sum();
  }
  Reconstruction scene = whole;
  options.max_iterations = kIterations;
  adjust(scene, tracks.observations, use, options);
  std::vector<Pose> from, to;
  for (size_t i = 0; i < scene.cameras.size(); i++) {
    if (!scene.cameras[i].used) continue;
    from.push_back(scene.cameras[i].pose());
    to.push_back(whole.cameras[i].pose());
  }
  const Similarity s = align(from, to, tracks.bar);
  half.cameras = std::move(scene.cameras);
  for (CameraState& camera : half.cameras) camera.set_pose(s(camera.pose()));
  return half;
}

}  // namespace

double disagreement_of_halves(const Reconstruction& scene, const Tracks& tracks, const Inliers& use,
                              const AdjustmentOptions& options) {
  const auto positions = observations_of_positions(tracks);
  double sum = 0, count = 0;
  for (int split = 0; split < kSplits; split++) {
    const std::vector<char> side = sides(tracks, positions, split);
    Half halves[2];
    for (int h = 0; h < 2; h++) {
      Inliers own = use;
      for (size_t i = 0; i < own.size(); i++) own[i] = own[i] && side[tracks.observations[i].position] == h;
      halves[h] = solve_half(scene, tracks, own, options);
    }
    Eigen::Index row = 0;
    for (size_t i = 0; i < scene.cameras.size(); i++) {
      if (!scene.cameras[i].used) continue;
      const CameraState &a = halves[0].cameras[i], &b = halves[1].cameras[i];
      const Quat turn = a.pose().orientation * glm::conjugate(b.pose().orientation);
      const Vec3 rotation = 2.0 * (turn.w < 0 ? -1.0 : 1.0) * Vec3(turn.x, turn.y, turn.z);
      const Vec3 shift = a.pose().position - b.pose().position;
      const auto add = [&](double difference) {
        const double variance = halves[0].variance[row] + halves[1].variance[row];
        row++;
        if (variance > 0) sum += difference * difference / variance, count++;
      };
      for (int k = 0; k < 3; k++) add(rotation[k]);
      for (int k = 0; k < 3; k++) add(shift[k]);
      for (int k = 0; k < kNumLensTerms; k++)
        if (options.free[k]) add(a.lens_terms()[k] - b.lens_terms()[k]);
    }
  }
  return count > 0 ? std::sqrt(sum / count) : 1;
}

}  // namespace lf
