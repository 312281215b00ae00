// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <memory>
#include <thread>

#include "calibration/adjustment.h"
#include "calibration/costs.h"

namespace lf {
namespace {

ceres::Problem::Options borrowed() {
  ceres::Problem::Options options;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.enable_fast_removal = false;
  return options;
}

std::unique_ptr<ceres::LossFunction> make_loss(const AdjustmentOptions& options) {
  if (!(options.robust > 0)) return nullptr;
  if (options.redescending) return std::make_unique<ceres::CauchyLoss>(options.robust);
  return std::make_unique<ceres::HuberLoss>(options.robust);
}

// Blocks of one kind, which no cost joins with each other: either can be eliminated.
struct Blocks {
  std::vector<double*> cameras, targets;
};

bool all_measured(const Reconstruction& scene, size_t camera) {
  for (int k = 0; k < kNumLensTerms; k++)
    if (!scene.measured(camera, k)) return false;
  return true;
}

}  // namespace

AdjustmentSummary adjust(Reconstruction& scene, const std::vector<Observation>& observations, const Inliers& use,
                         const AdjustmentOptions& options) {
  CameraManifold camera_manifold(options.free, options.free_poses);
  ceres::ProductManifold<ceres::EuclideanManifold<3>, ceres::SphereManifold<3>> bar_manifold;
  const std::unique_ptr<ceres::LossFunction> loss = make_loss(options);
  ceres::Problem problem(borrowed());
  std::vector<char> camera_used(scene.cameras.size()), target_used(scene.targets.size());
  for (size_t i = 0; i < observations.size(); i++) {
    const Observation& o = observations[i];
    CameraState& camera = scene.cameras[o.camera];
    TargetState& target = scene.targets[o.position];
    if (!use[i] || !camera.used || !target.has(o.light) || !residual(camera, target, o)) continue;
    ceres::CostFunction* cost;
    if (target.kind == TargetState::Kind::kBar)
      cost = new ReprojectionCost<true>(camera, o, options.sigma);
    else
      cost = new ReprojectionCost<false>(camera, o, options.sigma);
    problem.AddResidualBlock(cost, loss.get(), camera.v.data(), target.v.data());
    camera_used[o.camera] = target_used[o.position] = true;
  }
  Blocks blocks;
  const bool lenses = std::any_of(options.free.begin(), options.free.end(), [](bool f) { return f; });
  bool has_batch = false, has_pose_priors = false;
  for (size_t i = 0; i < scene.cameras.size(); i++) {
    if (!camera_used[i]) continue;
    double* block = scene.cameras[i].v.data();
    if (camera_manifold.TangentSize() == 0) {
      problem.SetParameterBlockConstant(block);
      continue;
    }
    problem.SetManifold(block, &camera_manifold);
    blocks.cameras.push_back(block);
    if (!scene.pose_priors.empty() && scene.pose_priors[i] && options.free_poses) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<PosePriorCost, PosePrior::kNumTerms, CameraState::kSize, 1>(
              new PosePriorCost{&*scene.pose_priors[i]}),
          nullptr, block, &scene.metres);
      has_pose_priors = true;
    }
    if (!lenses) continue;
    if (scene.lens_priors[i])
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<LensPriorCost, kNumLensTerms, CameraState::kSize>(
                                   new LensPriorCost{&*scene.lens_priors[i]}),
                               nullptr, block);
    if (all_measured(scene, i)) continue;
    auto* spread = new BatchSpreadCost;
    for (int k = 0; k < kNumLensTerms; k++)
      spread->weight[k] = scene.measured(i, k) ? 0 : 1 / scene.spread(k, options.shared[k]);
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<BatchSpreadCost, kNumLensTerms, CameraState::kSize, kNumLensTerms>(spread),
        nullptr, block, scene.batch_mean.data());
    has_batch = true;
  }
  std::unique_ptr<ceres::SubsetManifold> batch_manifold;
  if (has_batch) {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<BatchMeanCost, kNumLensTerms, kNumLensTerms>(new BatchMeanCost{&scene.batch}),
        nullptr, scene.batch_mean.data());
    std::vector<int> fixed;
    for (int k = 0; k < kNumLensTerms; k++)
      if (!options.free[k]) fixed.push_back(k);
    batch_manifold = std::make_unique<ceres::SubsetManifold>(kNumLensTerms, fixed);
    problem.SetManifold(scene.batch_mean.data(), batch_manifold.get());
  }
  bool has_bar = false;
  for (size_t i = 0; i < scene.targets.size(); i++) {
    if (!target_used[i]) continue;
    has_bar |= scene.targets[i].kind == TargetState::Kind::kBar;
    double* block = scene.targets[i].v.data();
    if (scene.targets[i].kind == TargetState::Kind::kBar) problem.SetManifold(block, &bar_manifold);
    if (options.free_targets)
      blocks.targets.push_back(block);
    else
      problem.SetParameterBlockConstant(block);
  }

  const bool free_metres = has_pose_priors && has_bar;
  if (has_pose_priors && !free_metres) problem.SetParameterBlockConstant(&scene.metres);

  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_SCHUR;
  solver.max_num_iterations = options.max_iterations;
  solver.function_tolerance = options.tolerance;
  solver.gradient_tolerance = 0;
  solver.parameter_tolerance = 1e-12;
  solver.num_threads = static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 1u, 8u));
  solver.initial_trust_region_radius = options.trust;
  solver.logging_type = ceres::SILENT;
  // The larger of the two groups is eliminated.
  auto* ordering = new ceres::ParameterBlockOrdering;
  const bool cameras_first =
      blocks.cameras.size() * camera_manifold.TangentSize() > blocks.targets.size() * (scene.targets[0].v.size() / 2);
  for (double* block : blocks.cameras) ordering->AddElementToGroup(block, cameras_first ? 0 : 1);
  for (double* block : blocks.targets) ordering->AddElementToGroup(block, cameras_first ? 1 : 0);
  if (free_metres) ordering->AddElementToGroup(&scene.metres, 1);
  if (has_batch) ordering->AddElementToGroup(scene.batch_mean.data(), 1);
  solver.linear_solver_ordering.reset(ordering);
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  return {summary.IsSolutionUsable(), summary.final_cost, static_cast<int>(summary.iterations.size())};
}

}  // namespace lf
