// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/accuracy.h"

#include <chrono>

#include <Eigen/Dense>

#include "calibration/adjustment.h"
#include "calibration/triangulation.h"
#include "calibration/uncertainty.h"

namespace lf::sim {
namespace {

// 95 % of normal vectors of 3 dimensions, and of 1, are within.
constexpr double kChi3 = 7.815, kChi1 = 3.841;
constexpr double kTransferDistance = 1.5;  // metres
constexpr double kConverged = 5;           // times the bound: a local minimum is much farther off

Eigen::Vector3d eigen(const Vec3& v) { return {v.x, v.y, v.z}; }

double normalised(const Vec3& error, const Eigen::Matrix3d& covariance) {
  return eigen(error).dot(covariance.ldlt().solve(eigen(error)));
}

struct Transfers {
  double squared = 0, count = 0;
};

// New points seen without noise by all cameras but one, predicted in that one.
Transfers transfers(const Rig& truth, const std::vector<CameraState>& found) {
  Transfers result;
  for (int n = 0; n < 9; n++) {
    const Vec3 point((n % 3 - 1) * 0.25, (n / 3 - 1) * 0.2, kTransferDistance);
    Tracks tracks;
    std::vector<uint32_t> seen;
    for (uint32_t i = 0; i < truth.cameras.size(); i++) {
      const auto pixel = truth.cameras[i].lens.project(truth.cameras[i].pose.camera_from_world(point));
      if (!pixel) continue;
      seen.push_back(static_cast<uint32_t>(tracks.observations.size()));
      tracks.observations.push_back({i, 0, 0, *pixel});
    }
    const size_t left_out = n * 7 % seen.size();
    const Observation held = tracks.observations[left_out];
    seen.erase(seen.begin() + static_cast<ptrdiff_t>(left_out));
    const auto predicted = triangulate(found, tracks, seen, 4);
    if (!predicted) continue;
    TargetState target;
    target.kind = TargetState::Kind::kPoint;
    for (int k = 0; k < 3; k++) target.v[k] = predicted->point[k];
    const auto e = residual(found[held.camera], target, held);
    result.squared += e ? glm::dot(*e, *e) : 1e6;
    result.count++;
  }
  return result;
}

// Cameras as far from `scene`'s, in metres, as the bound allows, at random.
std::vector<CameraState> at_the_bound(const Reconstruction& scene, const Uncertainty& bound, double unit,
                                      uint64_t seed) {
  std::mt19937_64 random(seed);
  const Eigen::VectorXd size = bound.covariance.diagonal().cwiseSqrt();
  Eigen::MatrixXd correlation = size.cwiseInverse().asDiagonal() * bound.covariance * size.cwiseInverse().asDiagonal();
  correlation.diagonal().array() += 1e-9;  // nothing moves along the gauge
  Eigen::VectorXd step(size.size());
  for (double& s : step) s = std::normal_distribution<double>()(random);
  step = size.asDiagonal() * (correlation.llt().matrixL() * step);
  std::vector<CameraState> cameras = scene.cameras;
  for (size_t i = 0; i < cameras.size(); i++) {
    const auto s = step.segment(bound.camera_row[i], bound.camera_size);
    const Pose pose = cameras[i].pose();
    cameras[i].set_pose(
        {(pose.position + Vec3(s[3], s[4], s[5])) * unit, Quat(1, s[0] / 2, s[1] / 2, s[2] / 2) * pose.orientation});
    for (size_t k = 0; k < bound.lens_terms.size(); k++)
      cameras[i].lens_terms()[bound.lens_terms[k]] += s[static_cast<Eigen::Index>(6 + k)];
  }
  return cameras;
}

}  // namespace

Errors& Errors::operator+=(const Errors& other) {
  for (int q = 0; q < kNumQuantities; q++) squared[q] += other.squared[q], bound[q] += other.bound[q];
  for (int q = 0; q < kTransfer; q++) inside[q] += other.inside[q];
  cameras += other.cameras, transfers += other.transfers;
  converged += other.converged, runs += other.runs;
  seconds = std::max(seconds, other.seconds);
  return *this;
}

Errors run_seed(const Study& study, uint64_t seed) {
  const Rig truth = make_array(study.array, seed);
  const Watched watched = watch(truth, study.path, seed + 1000000);
  SolveOptions options;
  options.distortion = study.distortion;
  if (study.prior) measure_lenses(truth, {}, seed + 2000000, options);
  Errors run;
  run.runs = 1;
  const auto begin = std::chrono::steady_clock::now();
  const Solution solution = solve_tracks(watched.tracks, options);
  run.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();

  const Reconstruction at_truth = true_scene(truth, watched, options);
  AdjustmentOptions model = solution.model;
  model.sigma = study.path.noise;
  const Uncertainty best = estimate_uncertainty(at_truth, watched.tracks.observations, watched.good, model);
  std::vector<Pose> found, expected;
  for (size_t i = 0; i < truth.cameras.size(); i++) {
    if (!solution.scene.cameras[i].used) return run;  // not converged
    found.push_back(solution.scene.cameras[i].pose());
    expected.push_back(truth.cameras[i].pose);
  }
  const Similarity s = align(found, expected);
  const double unit = study.path.bar > 0 ? study.path.bar : 1;  // of the scene at the truth, metres
  const Uncertainty& told = solution.uncertainty;
  const Mat3 turn = glm::mat3_cast(s.rotation);
  Eigen::Matrix3d r;
  for (int row = 0; row < 3; row++)
    for (int column = 0; column < 3; column++) r(row, column) = turn[column][row];
  std::vector<CameraState> aligned = solution.scene.cameras;
  for (size_t i = 0; i < found.size(); i++) {
    const Pose pose = s(found[i]);
    aligned[i].set_pose(pose);
    const Vec3 shift = pose.position - expected[i].position;
    Quat q = pose.orientation * glm::conjugate(expected[i].orientation);
    if (q.w < 0) q = -q;
    const Vec3 rotation(2 * q.x, 2 * q.y, 2 * q.z);
    const double focal = solution.scene.cameras[i].lens_terms()[kF] - truth.cameras[i].lens.fx();
    run.squared[Errors::kPosition] += glm::dot(shift, shift);
    run.squared[Errors::kRotation] += glm::dot(rotation, rotation);
    run.squared[Errors::kFocal] += focal * focal;
    const int b = best.camera_row[i], t = told.camera_row[i];
    run.bound[Errors::kPosition] += best.covariance.diagonal().segment(b + 3, 3).sum() * unit * unit;
    run.bound[Errors::kRotation] += best.covariance.diagonal().segment(b, 3).sum();
    run.bound[Errors::kFocal] += best.covariance(b + 6, b + 6);
    const Eigen::Matrix3d of_shift = r * told.covariance.block(t + 3, t + 3, 3, 3) * r.transpose() * s.scale * s.scale;
    const Eigen::Matrix3d of_rotation = r * told.covariance.block(t, t, 3, 3) * r.transpose();
    run.inside[Errors::kPosition] += normalised(shift, of_shift) < kChi3;
    run.inside[Errors::kRotation] += normalised(rotation, of_rotation) < kChi3;
    run.inside[Errors::kFocal] += focal * focal / told.covariance(t + 6, t + 6) < kChi1;
  }
  run.cameras = static_cast<double>(found.size());
  const Transfers predicted = transfers(truth, aligned);
  run.squared[Errors::kTransfer] = predicted.squared, run.transfers = predicted.count;
  run.bound[Errors::kTransfer] = transfers(truth, at_the_bound(at_truth, best, unit, seed + 3000000)).squared;
  run.converged = run.ratio(Errors::kPosition) < kConverged && run.ratio(Errors::kRotation) < kConverged;
  return run;
}

}  // namespace lf::sim
