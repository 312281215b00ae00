// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/uncertainty.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "calibration/adjustment.h"
#include "calibration/costs.h"

namespace lf {
namespace {

using Eigen::MatrixXd;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr double kSolid = 1e-13;  // relative information that keeps what nothing tells finite

constexpr Eigen::Index kPanel = 64;  // columns at a time
constexpr Eigen::Index kStack = 512;

struct TargetInformation {
  MatrixXd own;
  std::vector<int> rows;          // of the cameras that see it
  std::vector<MatrixXd> crosses;  // information between each camera's steps and the target's
};

// The inverse of L L'. A general solver would multiply all the zeros of a unit matrix.
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
  Builder(const Reconstruction& scene, const AdjustmentOptions& options)
      : scene_(scene), options_(options), manifold_(options.free, true) {
    result_.camera_size = manifold_.TangentSize();
    for (int k = 0; k < kNumLensTerms; k++)
      if (options.free[k]) result_.lens_terms.push_back(k);
    int rows = 0;
    for (const CameraState& camera : scene.cameras) {
      result_.camera_row.push_back(camera.used ? rows : -1);
      if (camera.used) rows += result_.camera_size;
    }
    information_ = MatrixXd::Zero(rows + num_terms() + 1, rows + num_terms() + 1);  // the batch's mean and the metres
    targets_.resize(scene.targets.size());
    for (const CameraState& camera : scene.cameras) {
      RowMajor j(CameraState::kSize, result_.camera_size);
      manifold_.PlusJacobian(camera.v.data(), j.data());
      camera_steps_.push_back(j);
    }
  }

  void add(const Observation& o) {
    const CameraState& camera = scene_.cameras[o.camera];
    const TargetState& target = scene_.targets[o.position];
    const bool bar = target.kind == TargetState::Kind::kBar;
    Eigen::Matrix<double, 2, CameraState::kSize, Eigen::RowMajor> by_camera;
    RowMajor by_target(2, bar ? 6 : 3);
    double error[2];
    double* jacobians[2] = {by_camera.data(), by_target.data()};
    const double* blocks[2] = {camera.v.data(), target.v.data()};
    if (bar) {
      if (!ReprojectionCost<true>(camera, o, options_.sigma).Evaluate(blocks, error, jacobians)) return;
      RowMajor steps(6, 5);
      bar_manifold_.PlusJacobian(target.v.data(), steps.data());
      by_target = RowMajor(by_target * steps);
    } else {
      if (!ReprojectionCost<false>(camera, o, options_.sigma).Evaluate(blocks, error, jacobians)) return;
    }
    const RowMajor c = by_camera * camera_steps_[o.camera];
    const int row = result_.camera_row[o.camera], n = result_.camera_size;
    information_.block(row, row, n, n) += c.transpose() * c;
    TargetInformation& t = targets_[o.position];
    if (t.rows.empty()) t.own = MatrixXd::Zero(by_target.cols(), by_target.cols());
    t.own += by_target.transpose() * by_target;
    // A camera may see both lights of a bar.
    const auto seen = std::find(t.rows.rbegin(), t.rows.rend(), row);
    if (seen == t.rows.rend()) {
      t.rows.push_back(row);
      t.crosses.push_back(c.transpose() * by_target);
    } else {
      t.crosses[t.rows.rend() - seen - 1] += c.transpose() * by_target;
    }
  }

  // information -= cross own^-1 cross', many targets at a time.
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
        stack.block(t.rows[i], columns, result_.camera_size, t.own.rows()) =
            own.matrixL().solve(t.crosses[i].transpose()).transpose();
      columns += t.own.rows();
    }
    flush();
    information_ = MatrixXd(information_.selfadjointView<Eigen::Lower>());
  }

  // Adds what was known of the lenses to `information`, whose camera i has its lens terms from lens_row(i) on.
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

  // A turn, a shift: in this order steps come.
  void add_pose_priors(int metres_row) {
    const bool bars = has_bars();
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
      if (!bars) continue;
      information_.block<6, 1>(row, metres_row) += own.topRightCorner<6, 1>();
      information_.block<1, 6>(metres_row, row) += own.bottomLeftCorner<1, 6>();
      information_(metres_row, metres_row) += own(6, 6);
    }
    if (!(information_(metres_row, metres_row) > 0)) information_(metres_row, metres_row) = 1;
  }

  Uncertainty finish() {
    eliminate_targets();
    const int rows = static_cast<int>(information_.rows()) - num_terms() - 1;
    add_pose_priors(rows + num_terms());
    add_priors(information_, rows, [&](size_t i) { return result_.camera_row[i] + 6; });
    invert();
    result_.covariance.conservativeResize(rows, rows);
    // As known before.
    std::vector<int> rank(scene_.cameras.size());
    int used = 0;
    for (size_t i = 0; i < rank.size(); i++) rank[i] = scene_.cameras[i].used ? used++ : -1;
    MatrixXd prior = MatrixXd::Zero((used + 1) * num_terms(), (used + 1) * num_terms());
    add_priors(prior, used * num_terms(), [&](size_t i) { return rank[i] * num_terms(); });
    result_.prior_covariance = prior.inverse().topLeftCorner(used * num_terms(), used * num_terms());
    return std::move(result_);
  }

 private:
  int num_terms() const { return static_cast<int>(result_.lens_terms.size()); }
  bool has_bars() const {
    return std::any_of(scene_.targets.begin(), scene_.targets.end(),
                       [](const TargetState& t) { return t.kind == TargetState::Kind::kBar; });
  }

  // With the similarities that the observations leave open taken out: P (S + K K')^-1 P', P the projection onto steps
  // that need no further alignment.
  void invert() {
    std::vector<Vec3> centres;
    Vec3 mean(0, 0, 0);
    for (const CameraState& camera : scene_.cameras)
      if (camera.used) centres.push_back(camera.pose().position);
    for (const Vec3& c : centres) mean += c;
    mean /= static_cast<double>(centres.size());
    const double turn_weight =
        std::pow(kTurnWeight * spread(centres), 2) * 2;  // align() has three axes: each turn moves two
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
    // A bar of unit length is a scale: no observation leaves it open. Known poses leave nothing open.
    for (int g = 0; g < (pose_priors_ ? 0 : has_bars() ? 6 : 7); g++) {
      // As firm as the observations hold the steps that it is made of.
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
    // P = 1 - gauge back weighted'
    const MatrixXd left = weighted.transpose() * inverse;
    inverse -= gauge * (back * left);
    const MatrixXd right = inverse * weighted;
    inverse -= (right * back.transpose()) * gauge.transpose();
    result_.covariance = (inverse + inverse.transpose()) / 2;
  }

  const Reconstruction& scene_;
  const AdjustmentOptions& options_;
  CameraManifold manifold_;
  ceres::ProductManifold<ceres::EuclideanManifold<3>, ceres::SphereManifold<3>> bar_manifold_;
  std::vector<RowMajor> camera_steps_;
  MatrixXd information_;
  bool pose_priors_ = false;
  std::vector<TargetInformation> targets_;
  Uncertainty result_;
};

}  // namespace

Uncertainty estimate_uncertainty(const Reconstruction& scene, const std::vector<Observation>& observations,
                                 const Inliers& use, const AdjustmentOptions& options) {
  Builder builder(scene, options);
  for (size_t i = 0; i < observations.size(); i++) {
    const Observation& o = observations[i];
    if (use[i] && scene.cameras[o.camera].used && scene.targets[o.position].has(o.light)) builder.add(o);
  }
  return builder.finish();
}

}  // namespace lf
