// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/adjustment.h"

#include <algorithm>
#include <memory>
#include <thread>

#include <Eigen/Geometry>

#include "base/error.h"
#include "calibration/costs.h"

namespace lf {

void CameraState::set_pose(const Pose& pose) {
  const Quat q = glm::normalize(pose.orientation);
  v[0] = q.w, v[1] = q.x, v[2] = q.y, v[3] = q.z;
  for (int i = 0; i < 3; i++) v[4 + i] = pose.position[i];
}

Lens CameraState::lens() const {
  const double* t = lens_terms();
  if (aspect == 1 && t[kP1] == 0 && t[kP2] == 0)
    return Lens(LensModel::kRadial, {t[kF], t[kCx], t[kCy], t[kK1], t[kK2]});
  return Lens(LensModel::kOpenCv, {t[kF], t[kF] * aspect, t[kCx], t[kCy], t[kK1], t[kK2], t[kP1], t[kP2]});
}

void CameraState::set_lens(const Lens& lens) {
  aspect = lens.fy() / lens.fx();
  double* t = lens_terms();
  t[kF] = lens.fx(), t[kCx] = lens.cx(), t[kCy] = lens.cy(), t[kK1] = lens.k1(), t[kK2] = lens.k2();
  t[kP1] = lens.p1(), t[kP2] = lens.p2();
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
  if (!projection::project(camera.v.data(), camera.aspect, &point.x, pixel)) return std::nullopt;
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
                         const AdjustmentOptions& options, ClockAdjustment* clocks) {
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
    const bool bar = target.kind == TargetState::Kind::kBar;
    if (clocks) {
      ClockAdjustment::Camera& clock = clocks->cameras[o.camera];
      const auto by = clock.by(clocks->stamp[i]);
      ceres::CostFunction* cost;
      if (bar)
        cost = new ClockedCost<true>(camera, o, options.sigma, clocks->velocity[i], by);
      else
        cost = new ClockedCost<false>(camera, o, options.sigma, clocks->velocity[i], by);
      problem.AddResidualBlock(cost, loss.get(), camera.v.data(), target.v.data(), clock.terms.data());
    } else {
      ceres::CostFunction* cost;
      if (bar)
        cost = new ReprojectionCost<true>(camera, o, options.sigma);
      else
        cost = new ReprojectionCost<false>(camera, o, options.sigma);
      problem.AddResidualBlock(cost, loss.get(), camera.v.data(), target.v.data());
    }
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
  for (size_t i = 0; clocks && i < scene.cameras.size(); i++)
    if (camera_used[i])
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<ClockPriorCost, kNumClockTerms, kNumClockTerms>(new ClockPriorCost), nullptr,
          clocks->cameras[i].terms.data());
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
  for (size_t i = 0; clocks && i < scene.cameras.size(); i++)
    if (camera_used[i]) ordering->AddElementToGroup(clocks->cameras[i].terms.data(), 1);
  if (has_batch) ordering->AddElementToGroup(scene.batch_mean.data(), 1);
  solver.linear_solver_ordering.reset(ordering);
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  return {summary.IsSolutionUsable(), summary.final_cost, static_cast<int>(summary.iterations.size())};
}

}  // namespace lf
