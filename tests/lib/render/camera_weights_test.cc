// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/camera_weights.h"
#include "lib/render/production.h"
#include "reference/generators.h"
#include "reference/renderer.h"
#include "support/test.h"

namespace lf {
namespace {

using reference::Random;

constexpr int kGridWidth = 45, kGridHeight = 33;

TEST(WeightGrid, SumsToExactlyOneAndIsBilinear) {
  constexpr CameraIndex kCameras = 100;
  Random random(1);
  WeightGrid grid(kGridWidth, kGridHeight, kCameras);
  std::vector<std::vector<double>> points;  // normalised weights of all cameras
  while (points.size() < static_cast<size_t>(grid.columns()) * grid.rows()) {
    std::vector<double> weights(kCameras);
    std::vector<WeightGrid::Share> shares;
    double sum = 0;
    for (CameraIndex i = 0; i < kCameras && shares.size() < WeightGrid::kMaxShares; i++) {
      if (random.one_in(3)) continue;
      shares.push_back({i, random.uniform(0, 1) / (i + 1)});
      sum += weights[i] = shares.back().weight;
    }
    for (double& w : weights) w /= sum;
    points.push_back(weights);
    grid.add_point(shares);
  }
  for (int y = 0; y < kGridHeight; y++)
    for (int x = 0; x < kGridWidth; x++) {
      int sum = 0;
      for (CameraIndex i = 0; i < kCameras; i++) {
        const int weight = grid.weight(i, x, y);
        ASSERT_GE(weight, 0);
        sum += weight;
        const size_t at = static_cast<size_t>(y / WeightGrid::kStep) * grid.columns() + x / WeightGrid::kStep;
        const double right = x % WeightGrid::kStep / 16., down = y % WeightGrid::kStep / 16.;
        const double expected =
            (1 - down) * ((1 - right) * points[at][i] + right * points[at + 1][i]) +
            down * ((1 - right) * points[at + grid.columns()][i] + right * points[at + grid.columns() + 1][i]);
        // Two running sums, each rounded at the points and once more.
        ASSERT_NEAR(weight, expected * WeightGrid::kOne, 2);
        if (weight > 0) {
          const Rect rect = grid.camera_rect(i);
          ASSERT_TRUE(x >= rect.x0 && x < rect.x1 && y >= rect.y0 && y < rect.y1);
        }
      }
      ASSERT_EQ(sum, WeightGrid::kOne);
    }
}

TEST(WeightGrid, OneCameraHasTheWholeWeight) {
  WeightGrid grid(1, 1, 3);
  const WeightGrid::Share share{2, 1e-300};
  for (int i = 0; i < grid.columns() * grid.rows(); i++) grid.add_point({&share, 1});
  EXPECT_EQ(grid.weight(2, 0, 0), WeightGrid::kOne);
  EXPECT_EQ(grid.camera_rect(2), (Rect{0, 0, 1, 1}));
  EXPECT_TRUE(grid.camera_rect(0).empty());
}

TEST(WeightGrid, CameraRectIsBoundedByNeighbouringPoints) {
  WeightGrid grid(100, 50, 2);
  for (int j = 0; j < grid.rows(); j++)
    for (int i = 0; i < grid.columns(); i++) {
      const WeightGrid::Share shares[] = {{0, 1}, {1, i == 3 && j == 1 ? 0.5 : 0}};
      grid.add_point(shares);
    }
  EXPECT_EQ(grid.camera_rect(1), (Rect{33, 1, 64, 32}));
  EXPECT_EQ(grid.weight(1, 48, 16), (WeightGrid::kOne + 2) / 3);
  EXPECT_EQ(grid.weight(1, 32, 16), 0);
  WeightGrid::Cell cell;
  EXPECT_FALSE(grid.find(1, 0, 0, cell));
}

constexpr int kWidth = 40, kHeight = 24;
constexpr Blending kByAperture{Blending::Kind::kAperture, 0.2, 0}, kByAngle{Blending::Kind::kAngle, 0, 4};

Blending random_blending(Random& random) {
  if (random.one_in(2)) return {Blending::Kind::kAperture, std::exp(random.uniform(-5, 2)), 0};
  return {Blending::Kind::kAngle, 0, random.integer(1, 8)};
}

struct Largest {
  double weight = 0;
  long pixels = 0, in_focus = 0;
};

// Weights add up to exactly 1 wherever there is a focus; single-camera plans equal the combined plan; the reference
// agrees within rounding to 1 / WeightGrid::kOne.
void compare(const Rig& rig, const CameraSet& out, const View& view, Random& random, Largest& largest) {
  const Mesh mesh = build_mesh(rig, out);
  const test::Production production(rig, mesh, view);
  if (!production.plan.blend()) return;
  const reference::ReferenceBlending expected(rig, mesh, view, WeightGrid::kStep);
  const auto own_weights = production.own_weights();
  for (int y = 0; y < view.height; y++)
    for (int x = 0; x < view.width; x++) {
      const size_t p = static_cast<size_t>(y) * view.width + x;
      largest.pixels++;
      const bool in_focus = production.owners.at(x, y) != FaceIdMap::kNone;
      largest.in_focus += in_focus;
      float sum = 0;
      for (const auto& own : own_weights) sum += own.weight[p];
      ASSERT_EQ(sum, in_focus ? 1 : 0) << "pixel " << x << ", " << y;
      if (!in_focus) continue;
      const std::vector<reference::Real> weights = expected.at(x, y);
      double met = 0;
      for (const auto& own : own_weights) {
        const double error = std::abs(own.weight[p] - static_cast<double>(weights[own.camera]));
        met += static_cast<double>(weights[own.camera]);
        largest.weight = std::max(largest.weight, error);
      }
      largest.weight = std::max(largest.weight, 1 - met);
    }
  for (const auto& own : own_weights) {
    ASSERT_FALSE(std::binary_search(out.begin(), out.end(), own.camera)) << "out of service, yet used";
    if (!random.one_in(4)) continue;
    const Rect rect = production.plan.camera_rect(own.camera);
    const ViewPlan alone(rig, mesh, view);
    ASSERT_EQ(pixel_weights(alone, FaceIdMap(alone, rect), own.camera, rect),
              pixel_weights(production.plan, production.owners, own.camera, rect));
  }
}

TEST(CameraWeights, MatchTheFormulaInRandomArrays) {
  Largest largest;
  for (int i = 0; i < 600; i++) {
    SCOPED_TRACE(i);
    Random random(i);
    const Rig rig = reference::random_rig(random);
    const CameraSet out = reference::random_out_of_service(random, rig);
    View view = reference::random_view(random, rig, kWidth, kHeight);
    view.blending = random_blending(random);
    compare(rig, out, view, random, largest);
    if (HasFatalFailure()) return;
  }
  std::printf("random arrays: %ld of %ld pixels in focus, largest weight error %.2g of 1/32768\n", largest.in_focus,
              largest.pixels, largest.weight * WeightGrid::kOne);
  EXPECT_LE(largest.weight, 2.01 / WeightGrid::kOne);
  EXPECT_GT(largest.in_focus, largest.pixels / 2);
}

TEST(CameraWeights, MatchTheFormulaInHardCases) {
  for (const reference::HardCase& hard : reference::hard_cases()) {
    SCOPED_TRACE(hard.name);
    Largest largest;
    for (int trial = 0; trial < 4; trial++) {
      Random random(trial);
      auto [rig, view] = hard.make(random);
      for (const Blending& blending : {Blending{Blending::Kind::kAperture, 0.6, 0}, kByAngle}) {
        view.blending = blending;
        compare(rig, {}, view, random, largest);
        if (HasFatalFailure()) return;
      }
    }
    std::printf("%-40s %.2g of 1/32768\n", hard.name, largest.weight * WeightGrid::kOne);
    EXPECT_LE(largest.weight, 2.01 / WeightGrid::kOne);
  }
}

// Returns the camera shares of a line of sight, indexed by the rig.
std::vector<double> shares_at(const Rig& rig, const View& view, const Vec2& ray) {
  const Mesh mesh = build_mesh(rig);
  CameraWeights weights(rig, mesh, view);
  std::vector<WeightGrid::Share> shares;
  const ViewPlan plan(rig, mesh, view);
  weights.at(ray, plan.focal_offset() / glm::dot(plan.focal_normal(), Vec3(ray, 1)), shares);
  std::vector<double> out(rig.cameras.size());
  double sum = 0;
  for (const auto& share : shares) sum += share.weight;
  for (const auto& share : shares) out[share.camera] = share.weight / sum;
  return out;
}

double difference(const std::vector<double>& a, const std::vector<double>& b) {
  double largest = 0;
  for (size_t i = 0; i < a.size(); i++) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

// Moving the viewpoint by 1e-5 of a pitch changes no weight by much more, if it is no nearer to a camera.
TEST(CameraWeights, AreContinuousInTheViewpoint) {
  double largest = 0;
  for (int i = 0; i < 3000; i++) {
    Random random(i);
    Rig rig = reference::planar_grid(4, 5, 0.1);
    for (Camera& camera : rig.cameras) {
      camera.pose.position += random.point_in_box(0.04);
      camera.pose.orientation = random.small_rotation(0.2);
      if (random.one_in(3)) camera.lens = Lens::from_fov_y(random.uniform(20, 80), camera.width, camera.height);
    }
    rig.topology = {};
    View view = reference::view_at(Vec3(0, 0, -0.3) + random.point_in_box(0.2));
    view.blending = random_blending(random);
    const Vec2 ray(random.uniform(-0.2, 0.2), random.uniform(-0.2, 0.2));
    const auto before = shares_at(rig, view, ray);
    view.pose.position += 1e-6 * random.direction();
    const double moved = difference(before, shares_at(rig, view, ray));
    largest = std::max(largest, moved);
  }
  std::printf("largest change of a weight by a step of 1e-5 pitches: %.2g\n", largest);
  EXPECT_LE(largest, 5e-3);
  EXPECT_GT(largest, 0);
}

TEST(CameraWeights, ViewpointAtACameraUsesOnlyThatCamera) {
  Random random(1);
  Rig rig = reference::planar_grid(3, 3, 0.1);
  for (Camera& camera : rig.cameras) camera.pose.position += random.point_in_box(0.03);
  for (CameraIndex at = 0; at < 9; at++) {
    View view = reference::view_at(rig.cameras[at].pose.position);
    view.blending = {Blending::Kind::kAngle, 0, 3};
    const std::vector<double> shares = shares_at(rig, view, {0.1, -0.05});
    EXPECT_GT(shares[at], 1 - 1e-6);
  }
}

TEST(CameraWeights, WiderAperturesUseMoreCameras) {
  const Rig rig = reference::planar_grid(9, 9, 0.1);
  View view = reference::view_at({0.02, -0.03, -1});
  int before = 0;
  for (const double aperture : {0.01, 0.35, 0.55, 0.85}) {
    view.blending = {Blending::Kind::kAperture, aperture, 0};
    const std::vector<double> shares = shares_at(rig, view, {0, 0});
    const int cameras = static_cast<int>(std::ranges::count_if(shares, [](double w) { return w > 0; }));
    EXPECT_GT(cameras, before);
    before = cameras;
    EXPECT_EQ(std::ranges::max_element(shares) - shares.begin(), 40);
  }
  EXPECT_GT(before, 40);
}

// At most WeightGrid::kMaxShares cameras: adding the 65th causes no jump.
TEST(CameraWeights, LimitsTheNumberOfCameras) {
  const Rig rig = reference::planar_grid(20, 20, 0.1);
  View view = reference::view_at({0.02, -0.03, -1});
  view.blending = {Blending::Kind::kAperture, 10, 0};
  std::vector<double> before;
  for (int i = 0; i < 50; i++) {
    view.pose.position.x += 1e-5;
    const std::vector<double> shares = shares_at(rig, view, {0, 0});
    EXPECT_LE(std::ranges::count_if(shares, [](double w) { return w > 0; }), 64);
    EXPECT_TRUE(i == 0 || difference(before, shares) <= 1e-4);
    before = shares;
  }
}

// Requests may contain finite numbers that overflow.
TEST(CameraWeights, AcceptAnyFiniteNumbers) {
  const Rig rig = reference::planar_grid(9, 9, 0.1);
  for (const double far : {1e160, 1e300})
    for (const double focal : {1e-300, 50., 1e300})
      for (const Blending& blending : {kByAperture, kByAngle}) {
        View view = reference::view_at({far, -far, far});
        view.lens = Lens::pinhole(focal, 24, 18);
        view.blending = blending;
        const test::Production production(rig, build_mesh(rig), view);
        for (int x = 0; x < view.width && production.plan.blend(); x += 7) {
          int sum = 0;
          for (CameraIndex i = 0; i < rig.cameras.size(); i++) sum += production.plan.blend()->weight(i, x, 3);
          ASSERT_EQ(sum, WeightGrid::kOne);
        }
      }
}

TEST(CameraWeights, OneTwoAndCoincidentCameras) {
  for (const Blending& blending : {kByAperture, kByAngle})
    for (const int cameras : {1, 2, 3}) {
      Rig rig = reference::planar_grid(1, cameras, 0.1);
      View view = reference::view_at({0.01, 0.02, -0.5});
      view.blending = blending;
      rig.topology = {};
      std::vector<double> shares = shares_at(rig, view, {0, 0});
      for (const double w : shares) EXPECT_TRUE(w > 0 && w <= 1);
      EXPECT_TRUE(cameras != 2 || shares[1] > shares[0]);
    }
  Rig rig = reference::planar_grid(3, 3, 0.1);
  rig.topology.type = Topology::Type::kTriangles;
  rig.topology.triangles = {{0, 1, 2}, {3, 4, 5}, {6, 7, 8}};
  for (Camera& camera : rig.cameras) camera.pose.position = {0, 0, 0};
  View view = reference::view_at({0, 0, 0});
  for (const Blending& blending : {kByAperture, kByAngle}) {
    view.blending = blending;
    double sum = 0;
    for (const double w : shares_at(rig, view, {0, 0})) sum += w;
    EXPECT_NEAR(sum, 1, 1e-12);
  }
}

}  // namespace
}  // namespace lf
