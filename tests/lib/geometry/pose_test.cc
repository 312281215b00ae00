// SPDX-License-Identifier: LGPL-2.1-or-later
#include "geometry/pose.h"
#include "support/expect_error.h"
#include "support/test.h"

namespace lf {
namespace {

void expect_near(const Vec3& a, const Vec3& b, double tolerance = 1e-14) {
  EXPECT_LE(glm::length(a - b), tolerance)
      << a.x << " " << a.y << " " << a.z << " is not " << b.x << " " << b.y << " " << b.z;
}

TEST(Pose, AxesAreRightDownForward) {
  const Pose identity;
  EXPECT_EQ(identity.right(), Vec3(1, 0, 0));
  EXPECT_EQ(identity.down(), Vec3(0, 1, 0));
  EXPECT_EQ(identity.forward(), Vec3(0, 0, 1));

  const Pose turned{{1, 2, 3}, Quat(std::sqrt(0.5), 0, std::sqrt(0.5), 0)};
  expect_near(turned.forward(), {1, 0, 0});
  expect_near(turned.right(), {0, 0, -1});
  expect_near(turned.world_from_camera({0, 0, 5}), {6, 2, 3});
  expect_near(turned.camera_from_world({6, 2, 3}), {0, 0, 5});
}

TEST(Pose, WorldAndCameraAreInverse) {
  const Pose pose{{1e6, -2e6, 3}, glm::normalize(Quat(0.3, -0.5, 0.7, 0.1))};
  expect_near(pose.camera_from_world(pose.world_from_camera({0.1, 0.2, 0.3})), {0.1, 0.2, 0.3}, 1e-9);
  EXPECT_EQ(pose.camera_from_world(pose.position), Vec3(0, 0, 0));
}

TEST(LookAt, LooksAtTheTargetWithoutRoll) {
  const Pose pose = look_at({1, 2, 3}, {4, -5, 9}, {0, 1, 0});
  EXPECT_EQ(pose.position, Vec3(1, 2, 3));
  EXPECT_NEAR(glm::length(pose.orientation), 1, 1e-15);
  expect_near(pose.forward(), glm::normalize(Vec3(3, -7, 6)));
  EXPECT_NEAR(pose.right().y, 0, 1e-15);
  EXPECT_GT(pose.down().y, 0);
  EXPECT_NEAR(glm::determinant(pose.rotation()), 1, 1e-14);
  expect_near(look_at({0, 0, 0}, {0, 0, 1}, {0, 1, 0}).forward(), {0, 0, 1});
  expect_near(look_at({0, 0, 0}, {0, 0, -1}, {0, 1, 0}).forward(), {0, 0, -1});
}

TEST(Plane, ContainsItsPoint) {
  const Plane plane = plane_through({1, 2, 3}, {0, 0.6, 0.8});
  EXPECT_NEAR(plane.signed_distance({1, 2, 3}), 0, 1e-15);
  EXPECT_NEAR(plane.signed_distance({7, 2.6, 3.8}), 1, 1e-15);
}

double max_difference(const Mat3& a, const Mat3& b) {
  double worst = 0;
  for (int c = 0; c < 3; c++)
    for (int r = 0; r < 3; r++) worst = std::max(worst, std::abs(a[c][r] - b[c][r]));
  return worst;
}

TEST(EulerAngles, SignsMatchTheDocumentation) {
  const auto axes = [](double yaw, double pitch, double roll) {
    return glm::mat3_cast(quat_from_euler({yaw, pitch, roll}));
  };
  EXPECT_NEAR(axes(90, 0, 0)[2].x, 1, 1e-15);   // forward is now right
  EXPECT_NEAR(axes(0, 90, 0)[2].y, -1, 1e-15);  // forward is now up
  EXPECT_NEAR(axes(0, 0, 90)[0].y, 1, 1e-15);   // right is now down
  const Vec3 forward = axes(90, 30, 0)[2];
  EXPECT_NEAR(forward.x, std::cos(M_PI / 6), 1e-15);
  EXPECT_NEAR(forward.y, -0.5, 1e-15);
}

TEST(EulerAngles, RoundTripOfAngles) {
  for (double yaw = -180; yaw <= 180; yaw += 22.5)
    for (double pitch = -85; pitch <= 85; pitch += 17)
      for (double roll = -170; roll <= 180; roll += 35) {
        const EulerAngles e = euler_from_quat(quat_from_euler({yaw, pitch, roll}));
        EXPECT_NEAR(std::remainder(e.yaw - yaw, 360), 0, 1e-12);
        EXPECT_NEAR(e.pitch, pitch, 1e-12);
        EXPECT_NEAR(std::remainder(e.roll - roll, 360), 0, 1e-12);
      }
}

TEST(EulerAngles, PolesKeepTheOrientation) {
  for (double pitch : {90.0, -90.0, 90 - 1e-5, -90 + 1e-7, 90 - 1e-9})
    for (double yaw : {-120.0, 0.0, 30.0}) {
      const Quat q = quat_from_euler({yaw, pitch, 25});
      const Quat back = quat_from_euler(euler_from_quat(q));
      EXPECT_LT(max_difference(glm::mat3_cast(q), glm::mat3_cast(back)), 1e-14) << pitch << " " << yaw;
    }
}

FocalMap map_of(int width, int height, int step = FocalMap::kMinStep) {
  FocalMap map = FocalMap::for_view(width, height, step);
  map.farthest = 0.25;
  map.nearest = 2;
  for (int i = 0; i < map.columns * map.rows; i++) map.levels.push_back(static_cast<uint8_t>(i * 37));
  return map;
}

TEST(FocalMap, NodesAreInTheMiddleOfTheirSquares) {
  const FocalMap map = map_of(22, 13);
  EXPECT_EQ(map.columns, 6);
  EXPECT_EQ(map.rows, 4);
  for (int j = 0; j < map.rows; j++)
    for (int i = 0; i < map.columns; i++)
      EXPECT_NEAR(map.inverse_at(4 * i + 1.5, 4 * j + 1.5), map.inverse_of(map.levels[j * map.columns + i]), 1e-12);
  const double four = map.inverse_of((map.levels[0] + map.levels[1] + map.levels[6] + map.levels[7]) / 4.0);
  EXPECT_NEAR(map.inverse_at(3.5, 3.5), four, 1e-12) << "half-way between four";
  EXPECT_EQ(map.inverse_at(-100, -100), map.inverse_of(map.levels[0])) << "clamped to the outer nodes";
}

TEST(FocalMap, RowsEqualSinglePositions) {
  const FocalMap map = map_of(50, 30);
  for (const double spacing : {1.0, 2.0, 16.0}) {
    float row[40];
    map.inverse_row(-5.5, spacing, 7.25, 40, row);
    for (int i = 0; i < 40; i++) EXPECT_NEAR(row[i], map.inverse_at(-5.5 + i * spacing, 7.25), 1e-6) << i;
  }
}

TEST(FocalMap, LevelsAreTheNearest) {
  const FocalMap map = map_of(8, 8);
  for (int level = 0; level <= 255; level++) EXPECT_EQ(map.level_of(map.inverse_of(level)), level);
  EXPECT_EQ(map.level_of(0), 0);
  EXPECT_EQ(map.level_of(100), 255);
}

TEST(FocalMap, LargeViewsHaveCoarserMaps) {
  const FocalMap map = FocalMap::for_view(16384, 16384);
  EXPECT_EQ(map.step, 16);
  EXPECT_LE(static_cast<size_t>(map.columns) * map.rows, FocalMap::kMaxNodes);
}

TEST(FocalMap, RefinedIsTheSameSurfaceToHalfALevel) {
  for (const auto& [width, height, step] : {std::array{333, 117, 8}, {2048, 96, 16}, {70, 70, 64}, {9, 9, 8}}) {
    const FocalMap map = map_of(width, height, step);
    const FocalMap fine = map.refined(width, height);
    ASSERT_EQ(fine.step, FocalMap::kMinStep);
    EXPECT_NO_THROW(validate({Plane{{0, 0, 1}, 0}, std::make_shared<FocalMap>(fine)}, width, height));
    const double half_a_level = (map.nearest - map.farthest) / FocalMap::kLevels / 2;
    for (int j = 0; j < fine.rows; j++)
      for (int i = 0; i < fine.columns; i++)
        ASSERT_NEAR(fine.inverse_of(fine.levels[j * fine.columns + i]), map.inverse_at(4 * i + 1.5, 4 * j + 1.5),
                    half_a_level + 1e-12)
            << width << "x" << height << " by " << step << ": " << i << ", " << j;
  }
}

TEST(FocalMap, FinestMapsAreNotRefined) {
  for (const int step : {1, 4, 6, 63}) {
    FocalMap map = FocalMap::for_view(100, 50, step);
    map.nearest = 1;
    map.levels.assign(static_cast<size_t>(map.columns * map.rows), 7);
    EXPECT_EQ(map.refined(100, 50), map) << step;
  }
}

TEST(FocalSurface, ErrorsNameTheProblem) {
  const auto with = [](const std::function<void(FocalMap&)>& change) {
    FocalMap map = map_of(22, 13);
    change(map);
    return FocalSurface{{{0, 0, 1}, -2}, std::make_shared<FocalMap>(map)};
  };
  EXPECT_NO_THROW(validate(with([](FocalMap&) {}), 22, 13));
  const std::function<void(FocalMap&)> bad[] = {
      [](FocalMap& m) { m.step = 0; },           [](FocalMap& m) { m.step = 65; },
      [](FocalMap& m) { m.columns++; },          [](FocalMap& m) { m.levels.pop_back(); },
      [](FocalMap& m) { m.farthest = -1; },      [](FocalMap& m) { m.nearest = m.farthest; },
      [](FocalMap& m) { m.nearest = INFINITY; }, [](FocalMap& m) { m.farthest = NAN; },
      [](FocalMap& m) { m.from.normal *= 2; },   [](FocalMap& m) { m.from.d = NAN; },
  };
  for (const auto& change : bad) EXPECT_ERROR(validate(with(change), 22, 13), "focal_map: ");
}

TEST(FocalSurface, ComparesContents) {
  const auto a = std::make_shared<FocalMap>(map_of(22, 13)), b = std::make_shared<FocalMap>(map_of(22, 13));
  EXPECT_EQ((FocalSurface{{}, a}), (FocalSurface{{}, b}));
  b->levels[3]++;
  EXPECT_NE((FocalSurface{{}, a}), (FocalSurface{{}, b}));
  EXPECT_NE((FocalSurface{{}, a}), (FocalSurface{{}, nullptr}));
}

}  // namespace
}  // namespace lf
