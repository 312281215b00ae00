// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/costs.h"

#include "support/test.h"

namespace lf {
namespace {

constexpr int kNumFree = 6 + kNumLensTerms;  // steps of a pose (rotation, position) and a lens

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

template <TargetState::Kind kKind>
void expect_derivatives(const CameraState& camera, const TargetState& target, uint32_t light) {
  Observation observation;
  observation.light = light, observation.pixel = {100, 80};
  const ReprojectionCost<kKind> cost(camera, target, observation, 0.5);
  const CameraManifold manifold({true, true, true, true, true, true, true}, true);
  const auto error_at = [&](const CameraState& c, const TargetState& t) {
    const double* blocks[] = {c.v.data(), t.v.data()};
    Eigen::Vector2d error;
    EXPECT_TRUE(cost.Evaluate(blocks, error.data(), nullptr));
    return error;
  };
  RowMajor by_camera(2, CameraState::kSize), by_target(2, target_size(kKind)), steps(CameraState::kSize, kNumFree);
  double* jacobians[] = {by_camera.data(), by_target.data()};
  const double* blocks[] = {camera.v.data(), target.v.data()};
  Eigen::Vector2d error;
  ASSERT_TRUE(cost.Evaluate(blocks, error.data(), jacobians));
  EXPECT_LE((error - error_at(camera, target)).norm(), 1e-12);
  manifold.PlusJacobian(camera.v.data(), steps.data());
  const RowMajor along = by_camera * steps;
  constexpr double kStep = 1e-6;
  for (int k = 0; k < kNumFree; k++) {
    Eigen::VectorXd step = Eigen::VectorXd::Zero(kNumFree);
    CameraState more = camera, less = camera;
    step[k] = kStep;
    manifold.Plus(camera.v.data(), step.data(), more.v.data());
    step[k] = -kStep;
    manifold.Plus(camera.v.data(), step.data(), less.v.data());
    const Eigen::Vector2d difference = (error_at(more, target) - error_at(less, target)) / (2 * kStep);
    EXPECT_LE((difference - along.col(k)).norm(), 1e-5 * (1 + difference.norm())) << "step " << k;
  }
  // The quaternion of a board moves along its manifold only.
  RowMajor target_steps = RowMajor::Identity(by_target.cols(), by_target.cols());
  const BoardManifold board_manifold;
  const bool board = kKind == TargetState::Kind::kBoard;
  if (board) {
    target_steps.resize(7, 6);
    board_manifold.PlusJacobian(target.v.data(), target_steps.data());
  }
  by_target = RowMajor(by_target * target_steps);
  for (int k = 0; k < by_target.cols(); k++) {
    TargetState more = target, less = target;
    Eigen::VectorXd step = Eigen::VectorXd::Zero(by_target.cols());
    for (const auto& [state, sign] : {std::pair(&more, 1), std::pair(&less, -1)}) {
      step[k] = sign * kStep;
      if (board)
        board_manifold.Plus(target.v.data(), step.data(), state->v.data());
      else
        state->v[k] += step[k];
    }
    const Eigen::Vector2d difference = (error_at(camera, more) - error_at(camera, less)) / (2 * kStep);
    EXPECT_LE((difference - by_target.col(k)).norm(), 1e-5 * (1 + difference.norm())) << "coordinate " << k;
  }
}

TEST(ReprojectionCost, DerivativesAreCorrect) {
  CameraState camera;
  camera.set_pose({{0.3, -0.2, 0.1}, glm::angleAxis(0.7, glm::normalize(Vec3(1, 2, -1)))});
  const Vec3 ahead = camera.pose().position + camera.pose().orientation * Vec3(0.2, -0.3, 1.5);
  using Kind = TargetState::Kind;
  TargetState target, board;
  target.v = {ahead.x, ahead.y, ahead.z, 0.36, 0.48, 0.8};
  board.set_board({ahead, glm::angleAxis(0.9, glm::normalize(Vec3(-1, 2, 0.5)))},
                  std::make_shared<const std::vector<Vec3>>(std::vector<Vec3>{{0, 0, 0}, {0.1, -0.2, 0}}));
  for (const Lens& lens :
       {Lens(LensModel::kRadial, {420, 160, 120, -0.15, 0.03}),
        Lens(LensModel::kOpenCv, {420, 430, 160, 120, -0.15, 0.03, 0.01, -0.02}),
        Lens(LensModel::kOpenCvFisheye, {200, 205, 160, 120, 0.1, -0.03, 0.01, -0.02}),
        Lens(LensModel::kSimpleRadialFisheye, {200, 160, 120, 0.1}),
        Lens(LensModel::kThinPrismFisheye, {200, 205, 160, 120, 0.1, -0.03, 0.01, -0.02, 0.03, -0.04, 0.02, -0.03}),
        Lens(LensModel::kFullOpenCv, {420, 430, 160, 120, -0.15, 0.03, 0.01, -0.02, 0.05, 0.2, -0.1, 0.03})}) {
    camera.set_lens(lens);
    const Lens stored = camera.lens();
    for (const Vec3& point : {Vec3(0.2, -0.3, 1.5), Vec3(0, 0, 1), Vec3(-0.6, 0.1, 0.7)})
      EXPECT_LE(glm::length(*stored.project(point) - *lens.project(point)), 1e-9) << lens_model_name(lens.model());
    expect_derivatives<Kind::kPoint>(camera, target, 0);
    for (const uint32_t light : {0, 1}) {
      expect_derivatives<Kind::kBar>(camera, target, light);
      expect_derivatives<Kind::kBoard>(camera, board, light);
    }
  }
}

// A fisheye lens sees beyond the plane Z = 0. Derivatives are correct there, and near the axis and on it.
TEST(ReprojectionCost, FisheyeLensesSeeBeyondNinetyDegrees) {
  CameraState camera;
  camera.set_lens(Lens(LensModel::kOpenCvFisheye, {200, 200, 160, 120, 0.1, -0.03, 0.01, -0.002}));
  TargetState target;
  for (const double angle : {0.0, 1e-7, 1e-5, 1e-3, 1.0, M_PI / 2, 1.65}) {
    target.v = {0.6 * std::sin(angle), -0.8 * std::sin(angle), std::cos(angle)};
    expect_derivatives<TargetState::Kind::kPoint>(camera, target, 0);
    const auto off = residual(camera, TargetState::at({target.v[0], target.v[1], target.v[2]}), {});
    EXPECT_LE(glm::length(off.value() - camera.lens().project({target.v[0], target.v[1], target.v[2]}).value()), 1e-9);
  }
}

TEST(ReprojectionCost, PointsBehindTheCameraFail) {
  CameraState camera;
  const double target[] = {0, 0, -1};
  for (const bool fisheye : {false, true}) {
    if (fisheye) camera.set_lens(Lens(LensModel::kOpenCvFisheye, {200, 200, 160, 120}));
    const double* blocks[] = {camera.v.data(), target};
    double error[2];
    EXPECT_FALSE(ReprojectionCost<TargetState::Kind::kPoint>(camera, {}, {}, 1).Evaluate(blocks, error, nullptr));
  }
}

TEST(PosePriorCost, IsTheDeviationInSigmas) {
  PosePrior prior;
  prior.mean = {{1, 2, 3}, glm::angleAxis(0.5, Vec3(0, 1, 0))};
  for (int k = 0; k < PosePrior::kNumTerms; k++) prior.root_information[k * 7] = 10;
  CameraState camera;
  camera.set_pose({{0.5, 1, 1.4}, glm::angleAxis(-0.02, Vec3(1, 0, 0)) * prior.mean.orientation});
  const double metres = 2;
  double error[6];
  ASSERT_TRUE(PosePriorCost{&prior}(camera.v.data(), &metres, error));
  const double expected[] = {0, 0, -2, -0.2, 0, 0};
  for (int k = 0; k < 6; k++) EXPECT_NEAR(error[k], expected[k], 1e-4) << k;
}

}  // namespace
}  // namespace lf
