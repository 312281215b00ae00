// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/hypothesis_levels.h"

#include "support/test.h"

namespace lf {
namespace {

View tilted_view() {
  const Pose pose = look_at({0.2, -0.1, 0.3}, {0, 0, 3}, {0, 1, 0});
  return {64, 48, Lens::from_fov_y(40, 64, 48), pose, {plane_through({0, 0, 2.5}, glm::normalize(Vec3(0.2, 0.1, -1)))}};
}

TEST(PlaneMap, IsTheViewersPlane) {
  const View view = tilted_view();
  const FocalMap map = plane_map(view, {{0, 0, 1}, 0}, 1, 0.2);
  for (int j = 0; j < map.rows; j++)
    for (int i = 0; i < map.columns; i++) {
      const Vec3 d = view.pose.rotation() * Vec3(*view.lens.unproject({4 * i + 1.5, 4 * j + 1.5}), 1);
      const double t = -view.focus.plane.signed_distance(view.pose.position) / glm::dot(view.focus.plane.normal, d);
      const double z = (view.pose.position + t * d).z;
      EXPECT_NEAR(map.inverse_of(map.levels[j * map.columns + i]), 1 / z, 0.8 / 255 / 2 + 1e-12);
    }
}

TEST(PlaneMap, PlanesBehindTheEyeAreFar) {
  View view;
  view.width = view.height = 16;
  view.lens = Lens::from_fov_y(40, 16, 16);
  view.focus.plane = plane_through({0, 0, -2}, {0, 0, 1});
  EXPECT_EQ(plane_inverse(view, {{0, 0, 1}, 0}, {0, 0, 1}), 0);
  EXPECT_EQ(plane_map(view, {{0, 0, 1}, 0}, 1, 0.2).levels, std::vector<uint8_t>(16, 0));
}

using enum DepthHypothesis::Kind;

FocalMap spike() {
  FocalMap map;
  map.columns = 5;
  map.rows = 4;
  map.levels.assign(20, 80);
  map.levels[1 * 5 + 2] = 240;
  return map;
}

TEST(DepthHypothesis, BlurredIsWeighted161AlongBothAxes) {
  const std::vector<uint8_t> levels = hypothesis_levels(spike(), {kBlurred, 0});
  EXPECT_EQ(levels[1 * 5 + 2], 170);  // 80 + 160 * 6/8 = 200 along rows; 80 + 120 * 6/8 along columns
  EXPECT_EQ(levels[1 * 5 + 1], 95);
  EXPECT_EQ(levels[0 * 5 + 2], 95);
  EXPECT_EQ(levels[0 * 5 + 1], 83);  // 80 + 2.5
  EXPECT_EQ(levels[3 * 5 + 4], 80);
}

TEST(DepthHypothesis, FartherAndNearerAreLocalExtremes) {
  const std::vector<uint8_t> farther = hypothesis_levels(spike(), {kFarther, 0}),
                             nearer = hypothesis_levels(spike(), {kNearer, 0});
  EXPECT_EQ(farther, std::vector<uint8_t>(20, 80));
  EXPECT_EQ(nearer[1 * 5 + 2], 240) << "centre of 3 x 3 nearest nodes";
  EXPECT_EQ(nearer[3 * 5 + 4], 83) << "smoothed: 80 + 160 / 8 / 8";
}

TEST(DepthHypothesis, ShiftsAndPlanesStayWithinTheLevels) {
  EXPECT_EQ(hypothesis_levels(spike(), {kShifted, 200})[0], 255);
  EXPECT_EQ(hypothesis_levels(spike(), {kShifted, -100})[0], 0);
  EXPECT_EQ(hypothesis_levels(spike(), {kShifted, 11})[0], 91);
  EXPECT_EQ(hypothesis_levels(spike(), {kPlane, 17}), std::vector<uint8_t>(20, 17));
  EXPECT_EQ(hypothesis_levels(spike(), {kPlane, 300}), std::vector<uint8_t>(20, 255));
}

TEST(DepthHypothesis, FocusedIsTheViewersPlane) {
  View view = tilted_view();
  FocalMap map = plane_map(view, {{0, 0, 1}, 0}, 1, 0.2);
  const std::vector<uint8_t> plane = map.levels;
  EXPECT_NE(std::ranges::adjacent_find(plane, std::not_equal_to<>()), plane.end()) << "levels differ";
  std::ranges::fill(map.levels, uint8_t{3});
  view.focus.map = std::make_shared<FocalMap>(map);
  EXPECT_EQ(hypothesis_levels(view, {kFocused, 0}), plane);
  EXPECT_EQ(hypothesis_levels(view, {kFocused, 9}), plane) << "value ignored";
  EXPECT_EQ(hypothesis_levels(view, {kShifted, 2}), std::vector<uint8_t>(plane.size(), 5))
      << "other kinds use the map";
}

TEST(DepthHypothesis, RoundsSweepAllPlanesAndStartWithTheSurface) {
  for (const unsigned first : {0u, 100u}) {
    std::set<int> planes;
    for (unsigned round = first; round < first + kSweepPlanes; round++) {
      const std::vector<DepthHypothesis> hypotheses = hypotheses_of_round(round);
      ASSERT_EQ(hypotheses.size(), 4u);
      EXPECT_EQ(hypotheses[0], (DepthHypothesis{kBlurred, 0}));
      ASSERT_EQ(hypotheses.back().kind, kPlane);
      for (const DepthHypothesis& hypothesis : hypotheses)
        if (hypothesis.kind == kPlane) planes.insert(hypothesis.value);
    }
    EXPECT_EQ(planes.size(), static_cast<size_t>(kSweepPlanes));
    EXPECT_EQ(*planes.begin(), 0);
    EXPECT_EQ(*planes.rbegin(), 255);
  }
}

TEST(DepthHypothesis, RoundsSometimesLookOutsideTheScene) {
  const LevelRange scene{100, 160};
  std::set<int> inside, outside;
  for (unsigned round = 0; round < kSweepPlanes * kOutsideEvery; round++) {
    const int level = hypotheses_of_round(round, scene).back().value;
    ASSERT_GE(level, 0);
    ASSERT_LE(level, 255);
    (level >= scene.first && level <= scene.last ? inside : outside).insert(level);
  }
  EXPECT_EQ(inside.size(), static_cast<size_t>(kSweepPlanes));
  EXPECT_EQ(*inside.begin(), 100);
  EXPECT_EQ(*inside.rbegin(), 160);
  EXPECT_EQ(outside.size(), static_cast<size_t>(kSweepPlanes));
  EXPECT_EQ(*outside.begin(), 0);
  EXPECT_EQ(*outside.rbegin(), 255);
}

TEST(DepthHypothesis, ViewHasOnePixelPerNode) {
  View view;
  view.width = 22;
  view.height = 13;
  view.lens = Lens(LensModel::kOpenCv, {300, 310, 10.2, 6.1, -0.1, 0.02, 0.001, -0.002});
  view.focus.map = std::make_shared<FocalMap>(FocalMap::for_view(22, 13));
  const View hypothesis = hypothesis_view(view);
  EXPECT_EQ(hypothesis.width, 6);
  EXPECT_EQ(hypothesis.height, 4);
  EXPECT_EQ(hypothesis.focus.map->step, 1);
  for (int j = 0; j < 4; j++)
    for (int i = 0; i < 6; i++) {
      const Vec2 node = *hypothesis.lens.unproject({i, j}), pixel = *view.lens.unproject({4 * i + 1.5, 4 * j + 1.5});
      EXPECT_LT(glm::distance(node, pixel), 1e-12);
    }
}

}  // namespace
}  // namespace lf
