// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/warp_depth_map.h"

#include "support/rigs.h"
#include "support/test.h"

namespace lf {
namespace {

const std::vector<DepthHypothesis> kFirst{{DepthHypothesis::Kind::kBlurred, 0}, {DepthHypothesis::Kind::kPlane, 10}},
    kSecond{{DepthHypothesis::Kind::kBlurred, 0}, {DepthHypothesis::Kind::kPlane, 20}},
    kThird{{DepthHypothesis::Kind::kBlurred, 0}, {DepthHypothesis::Kind::kPlane, 30}};

constexpr float kUnseen = std::numeric_limits<float>::infinity();

ViewRequest request_with(const std::vector<DepthHypothesis>& hypotheses, std::vector<uint8_t> levels) {
  ViewRequest request;
  const auto map = test::level_surface(12, 4, 0, 2.55, 0);
  map->levels = std::move(levels);
  request.view = {12, 4, Lens::pinhole(10, 5.5, 1.5), {}, {{{0, 0, 1}, -1}, map}};
  request.hypotheses = hypotheses;
  return request;
}

class LatestSurfaceTest : public testing::Test {
 protected:
  // Hypotheses for a surface with levels `were` selected `chosen` at these costs.
  std::vector<uint8_t> merge(const std::vector<DepthHypothesis>& hypotheses, const std::vector<uint8_t>& were,
                             const std::vector<uint8_t>& chosen, const std::vector<float>& costs,
                             std::pair<double, double> range = {0, 2.55}) {
    ViewRequest request = request_with(hypotheses, were);
    DepthSelection choice;
    choice.chosen = chosen;
    choice.least = costs;
    choice.lead.assign(chosen.size(), 0.5f);
    FocalMap map = *request.view.focus.map;
    for (size_t i = 0; i < map.levels.size(); i++)
      if (chosen[i] != 0) map.levels[i] = static_cast<uint8_t>(hypotheses[chosen[i]].value);
    map.farthest = range.first;
    map.nearest = range.second;
    latest_.merge(request, choice, map);
    View view = request.view;
    view.focus.map = std::make_shared<FocalMap>(map);
    latest_.set(view);
    return map.levels;
  }
  LatestSurface latest_;
};

using Levels = std::vector<uint8_t>;

TEST_F(LatestSurfaceTest, IsTheSelectionOfSequentialRequests) {
  latest_.leaves(kFirst, 0);
  EXPECT_EQ(merge(kFirst, {0, 0, 0}, {1, 0, 1}, {1, 1, 1}), (Levels{10, 0, 10}));
  latest_.leaves(kSecond, 0);
  EXPECT_EQ(merge(kSecond, {10, 0, 10}, {0, 1, 1}, {9, 9, 9}), (Levels{10, 20, 20})) << "at any earlier cost";
  EXPECT_EQ(latest_.underway(), 0u);
}

TEST_F(LatestSurfaceTest, KeepsBetterResultsOfConcurrentRounds) {
  latest_.leaves(kFirst, 0);
  latest_.leaves(kSecond, 0);
  merge(kFirst, {0, 0, 0}, {1, 1, 0}, {1, 5, 1});
  EXPECT_EQ(latest_.underway(), 1u);
  // The first node was better at 10, the second is at 20, the third did not change before.
  EXPECT_EQ(merge(kSecond, {0, 0, 0}, {1, 1, 1}, {2, 3, 9}), (Levels{10, 20, 20}));
}

TEST_F(LatestSurfaceTest, EqualCostsKeepTheLevel) {
  latest_.leaves(kFirst, 0);
  latest_.leaves(kSecond, 0);
  merge(kFirst, {0, 0, 0}, {1, 1, 1}, {1, 1, 1});
  EXPECT_EQ(merge(kSecond, {0, 0, 0}, {1, 0, 1}, {0.75f, 0.4f, kUnseen}), (Levels{10, 0, 10}))
      << "lead of 0.5";
}

TEST_F(LatestSurfaceTest, IgnoresLostRequests) {
  latest_.leaves(kFirst, 0);
  latest_.leaves(kSecond, 0);
  merge(kFirst, {0, 0, 0}, {1, 1, 1}, {1, 1, 1});
  latest_.leaves(kThird, 0);
  EXPECT_EQ(merge(kThird, {10, 10, 10}, {1, 1, 1}, {2, 2, 2}), (Levels{30, 30, 30})) << "included the first round";
  EXPECT_EQ(latest_.underway(), 0u);
  for (size_t i = 0; i < 2 * LatestSurface::kMaxInFlight; i++) latest_.leaves(kFirst, 0);
  EXPECT_EQ(latest_.underway(), LatestSurface::kMaxInFlight);
}

TEST_F(LatestSurfaceTest, ChangingTheRangeKeepsTheSurface) {
  latest_.leaves(kFirst, 0);
  latest_.leaves(kSecond, 0);
  merge(kFirst, {0, 0, 0}, {1, 1, 1}, {1, 1, 1}, {0, 2.55});
  EXPECT_EQ(merge(kSecond, {0, 0, 0}, {1, 1, 1}, {9, 9, 0}, {0, 5.1}), (Levels{5, 5, 20}));
}

TEST_F(LatestSurfaceTest, ReturnsLostHypotheses) {
  using Lost = std::vector<std::vector<DepthHypothesis>>;
  latest_.leaves(kFirst, 0xfffffffe);
  latest_.leaves(kSecond, 0xffffffff);
  ViewRequest request = request_with(kSecond, {0, 0, 0});
  request.sequence = 1;  // two requests later: sequence numbers wrap around
  latest_.lose(request);
  EXPECT_EQ(latest_.take_lost(1), (Lost{kFirst, kSecond})) << "requests keep their order";
  EXPECT_EQ(latest_.take_lost(1), Lost{}) << "once";
  latest_.leaves(kThird, 1);
  const uint32_t patience = 2 * 2 + LatestSurface::kPatience;
  EXPECT_EQ(latest_.take_lost(1 + patience), Lost{});
  EXPECT_EQ(latest_.take_lost(2 + patience), Lost{kThird});
  EXPECT_EQ(latest_.underway(), 0u);
}

TEST_F(LatestSurfaceTest, WarpsToAnotherView) {
  EXPECT_EQ(latest_.seen_from(request_with({}, {0, 0, 0}).view), nullptr);
  latest_.leaves(kFirst, 0);
  merge(kFirst, {100, 100, 100}, {0, 0, 0}, {1, 1, 1});
  View view = request_with({}, {0, 0, 0}).view;
  EXPECT_EQ(latest_.seen_from(view)->levels, (Levels{100, 100, 100}));
  view.pose.position.x = 0.1;
  EXPECT_EQ(latest_.seen_from(view)->levels, (Levels{100, 100, 100}));
  view.width = 24;
  EXPECT_EQ(latest_.seen_from(view)->columns, 6);
}

}  // namespace
}  // namespace lf
