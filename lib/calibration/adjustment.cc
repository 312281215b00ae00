// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/adjustment.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <thread>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <nlohmann/json.hpp>

#include "base/text.h"
#include "calibration/costs.h"

namespace lf {

void CameraState::set_pose(const Pose& pose) {
  const Quat q = glm::normalize(pose.orientation);
  v[0] = q.w, v[1] = q.x, v[2] = q.y, v[3] = q.z;
  for (int i = 0; i < 3; i++) v[4 + i] = pose.position[i];
}

Lens CameraState::lens() const {
  const double *const t = lens_terms(), f = t[kF], fy = f * aspect, cx = t[kCx], cy = t[kCy];
  const auto& k = fixed.k;
  const auto& d = fixed.d;
  switch (model) {
    case LensModel::kOpenCvFisheye: return Lens(model, {f, fy, cx, cy, t[kK1], t[kK2], t[kP1], t[kP2]});
    case LensModel::kFullOpenCv:
      return Lens(model, {f, fy, cx, cy, t[kK1], t[kK2], t[kP1], t[kP2], k[2], d[0], d[1], d[2]});
    case LensModel::kThinPrismFisheye:
      return Lens(model, {f, fy, cx, cy, t[kK1], t[kK2], t[kP1], t[kP2], k[2], k[3], fixed.s1, fixed.s2});
    default: break;
  }
  if (aspect == 1 && t[kP1] == 0 && t[kP2] == 0)
    return Lens(LensModel::kRadial, {t[kF], t[kCx], t[kCy], t[kK1], t[kK2]});
  return Lens(LensModel::kOpenCv, {t[kF], t[kF] * aspect, t[kCx], t[kCy], t[kK1], t[kK2], t[kP1], t[kP2]});
}

void CameraState::set_lens(const Lens& lens) {
  aspect = lens.fy() / lens.fx();
  fixed = lens.distortion();
  fixed.k[0] = fixed.k[1] = fixed.p1 = fixed.p2 = 0;
  model = !fixed.is_general ? LensModel::kOpenCv : lens.model();
  double* t = lens_terms();
  t[kF] = lens.fx(), t[kCx] = lens.cx(), t[kCy] = lens.cy(), t[kK1] = lens.k1(), t[kK2] = lens.k2();
  t[kP1] = lens.p1(), t[kP2] = lens.p2();
  if (!fixed.fisheye || model == LensModel::kThinPrismFisheye) return;
  model = LensModel::kOpenCvFisheye;
  for (int i = 0; i < 2; i++) t[kP1 + i] = std::exchange(fixed.k[2 + i], 0);
}

const char* CameraState::term_name(int term) const {
  constexpr const char* kNames[kNumLensTerms + 2] = {"f", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4"};
  return kNames[model == LensModel::kOpenCvFisheye && term >= kP1 ? term + 2 : term];
}

TargetState TargetState::at(const Vec3& point) {
  TargetState target;
  target.kind = Kind::kPoint;
  for (int i = 0; i < 3; i++) target.v[i] = point[i];
  return target;
}

Vec3 TargetState::point(uint32_t which) const {
  double p[3];
  switch (kind) {
    case Kind::kBar: projection::bar_end(v.data(), which, p); break;
    case Kind::kBoard: projection::board_corner(v.data(), &(*corners)[which].x, p); break;
    default: return {v[0], v[1], v[2]};
  }
  return {p[0], p[1], p[2]};
}

void TargetState::set_board(const Pose& world_from_board, std::shared_ptr<const std::vector<Vec3>> board_corners) {
  const Quat q = glm::normalize(world_from_board.orientation);
  for (int i = 0; i < 3; i++) v[i] = world_from_board.position[i];
  v[3] = q.w, v[4] = q.x, v[5] = q.y, v[6] = q.z;
  kind = Kind::kBoard;
  corners = std::move(board_corners);
}

bool Reconstruction::measured(int term) const {
  return std::ranges::any_of(lens_priors, [term](const auto& prior) { return prior && prior->known[term]; });
}

std::vector<Pose> Reconstruction::used_poses() const {
  std::vector<Pose> poses;
  for (const CameraState& camera : cameras)
    if (camera.used) poses.push_back(camera.pose());
  return poses;
}

std::optional<Vec2> Reconstruction::residual_of(const Observation& o) const {
  if (!cameras[o.camera].used || !targets[o.position].has(o.light)) return std::nullopt;
  return residual(cameras[o.camera], targets[o.position], o);
}

std::optional<Vec2> residual(const CameraState& camera, const TargetState& target, const Observation& observation) {
  const Vec3 point = target.point(observation.light);
  double pixel[2];
  if (!projection::project(camera, &point.x, pixel)) return std::nullopt;
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
  if (a.size() != b.size() || a.size() < 2) throw Error("alignment needs at least two cameras");
  // Coordinates are relative to the first camera, to keep precision far from the origin.
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
  if (!(size_a > 0 && size_b > 0))
    throw Error("cannot align: all cameras are at the same position, so the scale is unknown");
  const Eigen::Matrix4d t = Eigen::umeyama(points(a, kRotationWeight * size_a),
                                           points(b, kRotationWeight * (fixed_scale ? size_a : size_b)), !fixed_scale);
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

// The Ceres problem of an adjustment. It has no copies: the solver changes the blocks of the scene and of the clocks.
class BundleProblem {
 public:
  BundleProblem(Reconstruction& scene, const AdjustmentOptions& options, ClockAdjustment* clocks)
      : scene_(scene),
        options_(options),
        clocks_(clocks),
        loss_(make_loss(options)),
        camera_manifold_(options.free, options.free_poses),
        problem_(borrowed()),
        camera_used_(scene.cameras.size()),
        target_used_(scene.targets.size()) {}

  void add_observation(const Observation& o, size_t index) {
    CameraState& camera = scene_.cameras[o.camera];
    TargetState& target = scene_.targets[o.position];
    if (!scene_.residual_of(o)) return;
    std::vector<double*> blocks{camera.v.data(), target.v.data()};
    if (clocks_) blocks.push_back(clocks_->cameras[o.camera].terms.data());
    auto* cost = with_kind(target.kind, [&]<TargetState::Kind kKind>() -> ceres::CostFunction* {
      if (!clocks_) return new ReprojectionCost<kKind>(camera, target, o, options_.sigma);
      return new ClockedCost<kKind>(camera, target, o, options_.sigma, clocks_->velocity[index],
                                    clocks_->by(o.camera, index));
    });
    problem_.AddResidualBlock(cost, loss_.get(), blocks);
    camera_used_[o.camera] = target_used_[o.position] = true;
  }

  // Call this after all observations.
  void add_cameras() {
    for (size_t i = 0; i < scene_.cameras.size(); i++) {
      if (!camera_used_[i]) continue;
      double* block = scene_.cameras[i].v.data();
      if (camera_manifold_.TangentSize() == 0) {
        problem_.SetParameterBlockConstant(block);
        continue;
      }
      problem_.SetManifold(block, &camera_manifold_);
      cameras_.push_back(block);
      if (!scene_.pose_priors.empty() && scene_.pose_priors[i] && options_.free_poses) {
        add_prior(auto_diff<PosePrior::kNumTerms, CameraState::kSize, 1>(PosePriorCost{&*scene_.pose_priors[i]}), block,
                  &scene_.metres);
        has_pose_priors_ = true;
      }
      if (std::ranges::count(options_.free, true) > 0) add_lens_priors(i);
    }
    if (has_batch_) {
      double* const mean = scene_.batch_mean.data();
      add_prior(auto_diff<kNumLensTerms, kNumLensTerms>(BatchMeanCost{&scene_.batch}), mean);
      std::vector<int> fixed;
      for (int k = 0; k < kNumLensTerms; k++)
        if (!options_.free[k]) fixed.push_back(k);
      batch_manifold_.emplace(kNumLensTerms, fixed);
      problem_.SetManifold(mean, &*batch_manifold_);
    }
    for (double* clock : clock_blocks()) add_prior(auto_diff<kNumClockTerms, kNumClockTerms>(ClockPriorCost()), clock);
  }

  void add_targets() {
    for (size_t i = 0; i < scene_.targets.size(); i++) {
      if (!target_used_[i]) continue;
      const TargetState::Kind kind = scene_.targets[i].kind;
      targets_.push_back(scene_.targets[i].v.data());
      if (kind == TargetState::Kind::kBar) problem_.SetManifold(targets_.back(), &bar_manifold_);
      if (kind == TargetState::Kind::kBoard) problem_.SetManifold(targets_.back(), &board_manifold_);
      free_metres_ |= has_pose_priors_ && scene_.targets[i].is_rigid();
    }
    if (has_pose_priors_ && !free_metres_) problem_.SetParameterBlockConstant(&scene_.metres);
  }

  void solve() {
    ceres::Solver::Options solver;
    solver.linear_solver_type = ceres::DENSE_SCHUR;
    solver.max_num_iterations = options_.max_iterations;
    solver.function_tolerance = options_.tolerance;
    solver.gradient_tolerance = 0;
    solver.parameter_tolerance = 1e-12;
    solver.num_threads = static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 1u, 8u));
    solver.initial_trust_region_radius = options_.trust;
    solver.logging_type = ceres::SILENT;
    // The solver eliminates the larger of two groups. No cost joins two blocks of the same group, so either group can
    // be eliminated.
    auto* ordering = new ceres::ParameterBlockOrdering;
    const bool cameras_first =
        cameras_.size() * camera_manifold_.TangentSize() > targets_.size() * (scene_.targets[0].v.size() / 2);
    for (double* block : cameras_) ordering->AddElementToGroup(block, cameras_first ? 0 : 1);
    for (double* block : targets_) ordering->AddElementToGroup(block, cameras_first ? 1 : 0);
    if (free_metres_) ordering->AddElementToGroup(&scene_.metres, 1);
    for (double* block : clock_blocks()) ordering->AddElementToGroup(block, 1);
    if (has_batch_) ordering->AddElementToGroup(scene_.batch_mean.data(), 1);
    solver.linear_solver_ordering.reset(ordering);
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem_, &summary);
  }

 private:
  template <class... Blocks>
  void add_prior(ceres::CostFunction* cost, Blocks*... blocks) {
    problem_.AddResidualBlock(cost, nullptr, blocks...);
  }

  void add_lens_priors(size_t i) {
    double* block = scene_.cameras[i].v.data();
    if (scene_.lens_priors[i])
      add_prior(auto_diff<kNumLensTerms, CameraState::kSize>(LensPriorCost{&*scene_.lens_priors[i]}), block);
    BatchSpreadCost spread;
    bool all_measured = true;
    for (int k = 0; k < kNumLensTerms; k++) {
      spread.weight[k] = scene_.measured(i, k) ? 0 : 1 / scene_.spread(k, options_.shared[k]);
      all_measured = all_measured && scene_.measured(i, k);
    }
    if (all_measured) return;
    add_prior(auto_diff<kNumLensTerms, CameraState::kSize, kNumLensTerms>(spread), block, scene_.batch_mean.data());
    has_batch_ = true;
  }

  std::vector<double*> clock_blocks() const {
    std::vector<double*> blocks;
    for (size_t i = 0; clocks_ && i < scene_.cameras.size(); i++)
      if (camera_used_[i]) blocks.push_back(clocks_->cameras[i].terms.data());
    return blocks;
  }

  Reconstruction& scene_;
  const AdjustmentOptions& options_;
  ClockAdjustment* const clocks_;
  const std::unique_ptr<ceres::LossFunction> loss_;
  CameraManifold camera_manifold_;
  BarManifold bar_manifold_;
  BoardManifold board_manifold_;
  std::optional<ceres::SubsetManifold> batch_manifold_;
  ceres::Problem problem_;
  std::vector<char> camera_used_, target_used_;
  std::vector<double*> cameras_, targets_;  // blocks that the solver changes
  bool has_batch_ = false, has_pose_priors_ = false, free_metres_ = false;
};

}  // namespace

void adjust(Reconstruction& scene, const std::vector<Observation>& observations, const Inliers& use,
            const AdjustmentOptions& options, ClockAdjustment* clocks) {
  BundleProblem problem(scene, options, clocks);
  for (size_t i = 0; i < observations.size(); i++)
    if (use[i]) problem.add_observation(observations[i], i);
  problem.add_cameras();
  problem.add_targets();
  problem.solve();
}

namespace {

using Eigen::MatrixXd;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr double kSolid = 1e-13;  // relative damping that keeps unobserved parameters finite

constexpr Eigen::Index kPanel = 64;  // columns per block
constexpr Eigen::Index kStack = 512;

struct TargetInformation {
  MatrixXd own;
  std::vector<int> rows;  // first rows of the cameras that see the target, and of their clocks
  std::vector<MatrixXd> crosses;

  // A camera may see both lights of a bar, and many corners of a board.
  void add_cross(int row, const MatrixXd& cross) {
    const auto seen = std::find(rows.rbegin(), rows.rend(), row);
    if (seen != rows.rend()) {
      crosses[rows.rend() - seen - 1] += cross;
      return;
    }
    rows.push_back(row);
    crosses.push_back(cross);
  }
};

// Returns the inverse of L L'.
MatrixXd inverse_of(const Eigen::LLT<MatrixXd>& llt) {
  const MatrixXd& l = llt.matrixLLT();
  const Eigen::Index n = l.rows();
  MatrixXd inverse_l = MatrixXd::Identity(n, n), inverse(n, n);
  for (Eigen::Index k = 0; k < n; k += kPanel) {
    auto panel = inverse_l.block(k, k, n - k, std::min(kPanel, n - k));
    l.bottomRightCorner(n - k, n - k).triangularView<Eigen::Lower>().solveInPlace(panel);
  }
  for (Eigen::Index k = 0; k < n; k += kPanel) {
    const Eigen::Index width = std::min(kPanel, n - k);
    inverse.block(k, 0, width, k + width).noalias() =
        inverse_l.block(k, k, n - k, width).transpose() * inverse_l.block(k, 0, n - k, k + width);
  }
  return inverse.selfadjointView<Eigen::Lower>();
}

class Builder {
 public:
  Builder(const Reconstruction& scene, const AdjustmentOptions& options, const ClockAdjustment* clocks)
      : scene_(scene), options_(options), clocks_(clocks), manifold_(options.free, true) {
    result_.camera_size = manifold_.TangentSize();
    for (int k = 0; k < kNumLensTerms; k++)
      if (options.free[k]) result_.lens_terms.push_back(k);
    int used = 0;
    for (const CameraState& camera : scene.cameras) {
      rank_.push_back(used);
      result_.camera_row.push_back(camera.used ? used * result_.camera_size : -1);
      used += camera.used;
    }
    rows_ = used * result_.camera_size;
    const int size = rows_ + num_terms() + 1 + (clocks ? used * kNumClockTerms : 0);
    information_ = MatrixXd::Zero(size, size);
    targets_.resize(scene.targets.size());
    for (const CameraState& camera : scene.cameras) {
      RowMajor j(CameraState::kSize, result_.camera_size);
      manifold_.PlusJacobian(camera.v.data(), j.data());
      camera_steps_.push_back(j);
    }
  }

  void add(const Observation& o, size_t index) {
    const CameraState& camera = scene_.cameras[o.camera];
    const TargetState& target = scene_.targets[o.position];
    Eigen::Matrix<double, 2, CameraState::kSize, Eigen::RowMajor> by_camera;
    RowMajor by_target(2, target_size(target.kind));
    double error[2];
    double* jacobians[2] = {by_camera.data(), by_target.data()};
    const double* blocks[2] = {camera.v.data(), target.v.data()};
    const bool visible = with_kind(target.kind, [&]<TargetState::Kind kKind>() {
      return ReprojectionCost<kKind>(camera, target, o, options_.sigma).Evaluate(blocks, error, jacobians);
    });
    if (!visible) return;
    if (target.is_rigid()) {
      const bool bar = target.kind == TargetState::Kind::kBar;
      const ceres::Manifold& manifold = bar ? static_cast<const ceres::Manifold&>(bar_manifold_) : board_manifold_;
      RowMajor steps(manifold.AmbientSize(), manifold.TangentSize());
      manifold.PlusJacobian(target.v.data(), steps.data());
      by_target = RowMajor(by_target * steps);
    }
    const RowMajor c = by_camera * camera_steps_[o.camera];
    const int row = result_.camera_row[o.camera], n = result_.camera_size;
    information_.block(row, row, n, n) += c.transpose() * c;
    TargetInformation& t = targets_[o.position];
    if (t.rows.empty()) t.own = MatrixXd::Zero(by_target.cols(), by_target.cols());
    t.own += by_target.transpose() * by_target;
    t.add_cross(row, c.transpose() * by_target);
    if (!clocks_) return;
    const auto by_terms = clocks_->by(o.camera, index);
    const Vec2 velocity = clocks_->velocity[index] / (options_.sigma * o.sigma);
    const Eigen::Matrix<double, 2, kNumClockTerms> k =
        Eigen::Vector2d(velocity.x, velocity.y) * Eigen::Map<const Eigen::Vector3d>(by_terms.data()).transpose();
    const int clock = clock_row(o.camera);
    information_.block<kNumClockTerms, kNumClockTerms>(clock, clock) += k.transpose() * k;
    information_.block(clock, row, kNumClockTerms, n) += k.transpose() * c;
    t.add_cross(clock, k.transpose() * by_target);
  }

  // information -= cross own^-1 cross', for many targets at a time.
  void eliminate_targets() {
    MatrixXd stack = MatrixXd::Zero(information_.rows(), kStack);
    Eigen::Index columns = 0;
    const auto flush = [&] {
      information_.selfadjointView<Eigen::Lower>().rankUpdate(stack.leftCols(columns), -1);
      stack.leftCols(columns).setZero();
      columns = 0;
    };
    for (TargetInformation& t : targets_) {
      if (t.rows.empty()) continue;
      t.own.diagonal() *= 1 + kSolid;
      const Eigen::LLT<MatrixXd> own(t.own);
      if (columns + t.own.rows() > kStack) flush();
      for (size_t i = 0; i < t.rows.size(); i++)
        stack.block(t.rows[i], columns, t.crosses[i].rows(), t.own.rows()) =
            own.matrixL().solve(t.crosses[i].transpose()).transpose();
      columns += t.own.rows();
    }
    flush();
    information_ = MatrixXd(information_.selfadjointView<Eigen::Lower>());
  }

  template <class LensRow>
  void add_priors(MatrixXd& information, int batch_row, const LensRow& lens_row) const {
    for (size_t i = 0; i < scene_.cameras.size(); i++) {
      if (!scene_.cameras[i].used) continue;
      const int row = lens_row(i);
      if (scene_.lens_priors[i]) {
        const Eigen::Map<const Eigen::Matrix<double, kNumLensTerms, kNumLensTerms, Eigen::RowMajor>> root(
            scene_.lens_priors[i]->root_information.data());
        const Eigen::Matrix<double, kNumLensTerms, kNumLensTerms> full = root.transpose() * root;
        for (int a = 0; a < num_terms(); a++)
          for (int b = 0; b < num_terms(); b++)
            information(row + a, row + b) += full(result_.lens_terms[a], result_.lens_terms[b]);
      }
      for (int a = 0; a < num_terms(); a++) {
        const int k = result_.lens_terms[a];
        if (scene_.measured(i, k)) continue;
        const double w = std::pow(scene_.spread(k, options_.shared[k]), -2);
        information(row + a, row + a) += w;
        information(batch_row + a, batch_row + a) += w;
        information(row + a, batch_row + a) -= w;
        information(batch_row + a, row + a) -= w;
      }
    }
    for (int a = 0; a < num_terms(); a++) {
      const double width = scene_.batch.width[result_.lens_terms[a]];
      information(batch_row + a, batch_row + a) += 1 / (width * width);
    }
  }

  void add_pose_priors(int metres_row) {
    const bool rigid = has_rigid_targets();
    for (size_t i = 0; i < scene_.pose_priors.size(); i++) {
      const int row = result_.camera_row[i];
      if (row < 0 || !scene_.pose_priors[i]) continue;
      const Eigen::Map<const Eigen::Matrix<double, PosePrior::kNumTerms, PosePrior::kNumTerms, Eigen::RowMajor>> root(
          scene_.pose_priors[i]->root_information.data());
      const Vec3 at = scene_.cameras[i].pose().position;
      Eigen::Matrix<double, PosePrior::kNumTerms, 7> by_step;
      by_step << root.rightCols<3>(), root.leftCols<3>() * scene_.metres,
          root.leftCols<3>() * Eigen::Vector3d(at.x, at.y, at.z);
      const Eigen::Matrix<double, 7, 7> own = by_step.transpose() * by_step;
      information_.block<6, 6>(row, row) += own.topLeftCorner<6, 6>();
      pose_priors_ = true;
      if (!rigid) continue;
      information_.block<6, 1>(row, metres_row) += own.topRightCorner<6, 1>();
      information_.block<1, 6>(metres_row, row) += own.bottomLeftCorner<1, 6>();
      information_(metres_row, metres_row) += own(6, 6);
    }
    if (!(information_(metres_row, metres_row) > 0)) information_(metres_row, metres_row) = 1;
  }

  Uncertainty finish() {
    eliminate_targets();
    add_pose_priors(rows_ + num_terms());
    add_priors(information_, rows_, [&](size_t i) { return result_.camera_row[i] + 6; });
    for (Eigen::Index row = rows_ + num_terms() + 1; row < information_.rows(); row++)
      information_(row, row) += std::pow(kClockSigmas[(row - rows_ - num_terms() - 1) % kNumClockTerms], -2);
    invert();
    if (clocks_) judge_clocks();
    result_.covariance.conservativeResize(rows_, rows_);
    const int used = rows_ / result_.camera_size;
    MatrixXd prior = MatrixXd::Zero((used + 1) * num_terms(), (used + 1) * num_terms());
    add_priors(prior, used * num_terms(), [&](size_t i) { return rank_[i] * num_terms(); });
    result_.prior_covariance = prior.inverse().topLeftCorner(used * num_terms(), used * num_terms());
    return std::move(result_);
  }

 private:
  int num_terms() const { return static_cast<int>(result_.lens_terms.size()); }
  int clock_row(size_t camera) const { return rows_ + num_terms() + 1 + rank_[camera] * kNumClockTerms; }

  void judge_clocks() {
    const Eigen::Index used = rows_ / result_.camera_size;
    for (size_t i = 0; i < scene_.cameras.size(); i++) {
      std::array<double, kNumClockTerms>& sigmas = result_.clock_sigmas.emplace_back();
      if (!scene_.cameras[i].used) continue;
      for (int k = 0; k < kNumClockTerms; k++) {
        Eigen::VectorXd weights = Eigen::VectorXd::Zero(information_.rows());
        for (Eigen::Index j = 0; j < used && k < 2; j++)
          weights[rows_ + num_terms() + 1 + j * kNumClockTerms + k] = -1 / static_cast<double>(used);
        weights[clock_row(i) + k] += 1;
        sigmas[k] = result_.sigma_of(weights);
      }
    }
  }

  bool has_rigid_targets() const {
    return std::any_of(scene_.targets.begin(), scene_.targets.end(), [](const TargetState& t) { return t.is_rigid(); });
  }

  // Inverts the information with the unobserved similarities removed: P (S + K K')^-1 P', P the projection onto
  // parameter changes that are already aligned.
  void invert() {
    std::vector<Vec3> centres;
    Vec3 mean(0, 0, 0);
    for (const Pose& pose : scene_.used_poses()) centres.push_back(pose.position), mean += pose.position;
    mean /= static_cast<double>(centres.size());
    const double turn_weight =
        std::pow(kRotationWeight * spread(centres), 2) * 2;  // align() has three axes; each rotation moves two
    const Eigen::Index size = information_.rows();
    MatrixXd gauge = MatrixXd::Zero(size, 7), weighted = MatrixXd::Zero(size, 7);
    for (size_t i = 0; i < scene_.cameras.size(); i++) {
      const int row = result_.camera_row[i];
      if (row < 0) continue;
      const Vec3 c = scene_.cameras[i].pose().position - mean;
      for (int axis = 0; axis < 3; axis++) {
        Vec3 unit(0, 0, 0);
        unit[axis] = 1;
        const Vec3 moved = glm::cross(unit, c);
        gauge(row + axis, axis) = 1;
        for (int k = 0; k < 3; k++) gauge(row + 3 + k, axis) = moved[k];
        gauge(row + 3 + axis, 3 + axis) = 1;
        gauge(row + 3 + axis, 6) = c[axis];
      }
      weighted.middleRows(row, 3) = gauge.middleRows(row, 3) * turn_weight;
      weighted.middleRows(row + 3, 3) = gauge.middleRows(row + 3, 3);
    }
    const MatrixXd overlap = gauge.transpose() * weighted;
    // A target of known size fixes the scale. Pose priors leave no gauge freedom.
    for (int g = 0; g < (pose_priors_ ? 0 : has_rigid_targets() ? 6 : 7); g++) {
      const Eigen::VectorXd k = weighted.col(g) / weighted.col(g).norm();
      const double firm = k.cwiseAbs2().dot(information_.diagonal());
      information_ += firm * k * k.transpose();
    }
    const Eigen::VectorXd scale = information_.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    MatrixXd scaled = scale.asDiagonal() * information_ * scale.asDiagonal();
    scaled.diagonal().array() += kSolid;
    const Eigen::LLT<MatrixXd> llt(scaled);
    MatrixXd inverse =
        llt.info() == Eigen::Success ? inverse_of(llt) : MatrixXd(scaled.ldlt().solve(MatrixXd::Identity(size, size)));
    inverse = scale.asDiagonal() * inverse * scale.asDiagonal();
    const MatrixXd back = overlap.inverse();
    const MatrixXd left = weighted.transpose() * inverse;
    inverse -= gauge * (back * left);
    const MatrixXd right = inverse * weighted;
    inverse -= (right * back.transpose()) * gauge.transpose();
    result_.covariance = (inverse + inverse.transpose()) / 2;
  }

  const Reconstruction& scene_;
  const AdjustmentOptions& options_;
  const ClockAdjustment* const clocks_;
  CameraManifold manifold_;
  BarManifold bar_manifold_;
  BoardManifold board_manifold_;
  // Rows of the information: cameras, batch mean, metres, clocks.
  int rows_ = 0;           // of all cameras
  std::vector<int> rank_;  // number of used cameras before each camera
  std::vector<RowMajor> camera_steps_;
  MatrixXd information_;
  bool pose_priors_ = false;
  std::vector<TargetInformation> targets_;
  Uncertainty result_;
};

}  // namespace

Uncertainty estimate_uncertainty(const Reconstruction& scene, const std::vector<Observation>& observations,
                                 const Inliers& use, const AdjustmentOptions& options, const ClockAdjustment* clocks) {
  Builder builder(scene, options, clocks);
  for (size_t i = 0; i < observations.size(); i++) {
    const Observation& o = observations[i];
    if (use[i] && scene.cameras[o.camera].used && scene.targets[o.position].has(o.light)) builder.add(o, i);
  }
  return builder.finish();
}

std::optional<size_t> CameraCovariance::index_of(const std::string& parameter) const {
  const auto it = std::find(parameters.begin(), parameters.end(), parameter);
  if (it == parameters.end()) return std::nullopt;
  return static_cast<size_t>(it - parameters.begin());
}

std::optional<CameraCovariance> parse_camera_covariance(const JsonValue& camera) {
  constexpr const char* kNames[] = {"f",  "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2",
                                    "k3", "k4", "x",  "y",  "z",  "rx", "ry", "rz"};
  const auto value = camera.find("covariance");
  if (!value || !value->find("parameters")) return std::nullopt;
  CameraCovariance covariance;
  for (const JsonValue& parameter : value->at("parameters").elements()) {
    const std::string name = parameter.text();
    if (std::find(std::begin(kNames), std::end(kNames), name) == std::end(kNames))
      parameter.fail("\"" + name + "\" is not a parameter of a camera");
    if (covariance.index_of(name)) parameter.fail("\"" + name + "\" comes twice; remove one of the two");
    covariance.parameters.push_back(name);
  }
  const size_t n = covariance.parameters.size();
  const JsonValue matrix = value->at("matrix");
  for (const JsonValue& row : matrix.elements(n))
    for (const JsonValue& element : row.elements(n)) covariance.matrix.push_back(element.number());
  for (size_t i = 0; i < n; i++) {
    if (!(covariance.at(i, i) >= 0)) matrix.fail("a variance is negative");
    for (size_t j = 0; j < i; j++) {
      const double size = std::sqrt(covariance.at(i, i) * covariance.at(j, j));
      if (std::abs(covariance.at(i, j) - covariance.at(j, i)) > 1e-6 * size) matrix.fail("is not symmetric");
      if (std::abs(covariance.at(i, j)) > size * (1 + 1e-6)) matrix.fail("has a correlation above 1");
    }
  }
  return covariance;
}

nlohmann::ordered_json to_json(const CameraCovariance& covariance) {
  const size_t n = covariance.parameters.size();
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (size_t i = 0; i < n; i++)
    rows.push_back(std::vector<double>(covariance.matrix.begin() + static_cast<ptrdiff_t>(i * n),
                                       covariance.matrix.begin() + static_cast<ptrdiff_t>((i + 1) * n)));
  return {{"parameters", covariance.parameters}, {"matrix", rows}};
}

}  // namespace lf
