// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/depth_loop.h"

#include <deque>

#include "lib/focus/array_of_walls.h"
#include "support/test.h"
#include "wire/consistency_codec.h"

namespace lf {
namespace {

constexpr DepthEstimator::Settings kSurface{FocusMode::kSurface, 1.2, 6};

class DepthLoopTest : public testing::Test {
 protected:
  DepthLoopTest() { finder_.set_rig(std::make_shared<const Rig>(walls_.rig)); }

  // Creates the viewer's next request from `found`, and lets `node` answer its depth hypotheses.
  ViewRequest turn(const std::optional<DepthEstimate>& found) {
    ViewRequest request;
    request.view_id = 3;
    request.sequence = sequence_++;
    request.view = walls_.view(0);
    request.view.focus.map = nullptr;
    if (found) {
      request.hypotheses = found->plan.hypotheses;
      request.gains = found->gains;
      apply_plan(found->plan, request);
    }
    finder_.begin();
    if (request.hypotheses.empty()) return request;
    const wire::ConsistencyHeader header{3, request.sequence, walls_.rig.hash(), 0, {}};
    unit_ = wire::encode_consistency(header, walls_.moments(request.view, request.hypotheses, walls_.own));
    return request;
  }
  DepthLoop::Taken take(const ViewRequest& request) { return finder_.take({unit_.data(), unit_.size()}, request); }

  test::ArrayOfWalls walls_;
  DepthLoop finder_;
  uint32_t sequence_ = 0xfffffffa;
  ByteBuffer unit_;
};

TEST_F(DepthLoopTest, FindsTheSurfaceFromConsistencyUnits) {
  std::optional<DepthEstimate> found;
  ViewRequest request;
  for (int i = 0; i < 10; i++) {
    request = turn(found);
    if (!request.hypotheses.empty()) {
      const DepthLoop::Taken taken = take(request);
      EXPECT_EQ(taken.ahead, 0);
      EXPECT_EQ(taken.problem, "");
      EXPECT_EQ(finder_.bytes(), unit_.size());
    }
    finder_.adapt_rate(true, 1);
    found = finder_.next(request, kSurface, true);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->sequence, request.sequence);
    finder_.set_accepted(true);
  }
  ASSERT_TRUE(request.view.focus.map);
  EXPECT_NEAR(request.view.focus.map->inverse_at(20, 60), 1 / 3., 0.05);
  EXPECT_NEAR(request.view.focus.map->inverse_at(140, 60), 1 / 1.5, 0.05);
  EXPECT_TRUE(found->gains.use) << "the surface is where the scene is";
  EXPECT_GT(finder_.state().rounds, 5u);

  finder_.clear();
  EXPECT_EQ(finder_.state().rounds, 0u);
  EXPECT_EQ(finder_.bytes(), 0u);
}

TEST_F(DepthLoopTest, DistinguishesUnitsOfOtherRequests) {
  const ViewRequest first = turn({});
  ViewRequest request = turn(finder_.next(first, kSurface, false));
  ASSERT_FALSE(request.hypotheses.empty());
  request.sequence -= 2;
  EXPECT_EQ(take(request).ahead, 2);
  request.sequence += 3;
  EXPECT_EQ(take(request).ahead, -1);
  request.sequence -= 1;
  request.view_id = 4;
  EXPECT_LT(take(request).ahead, 0) << "for another view";
  EXPECT_EQ(finder_.bytes(), 0u);
  request.view_id = 3;
  request.rig_hash = 77;
  EXPECT_EQ(take(request).problem, "of another rig");
  unit_.resize(unit_.size() - 1);
  request.rig_hash = 0;
  EXPECT_NE(take(request).problem, "");
  unit_.resize(3);
  const DepthLoop::Taken taken = take(request);
  EXPECT_LT(taken.ahead, 0);
  EXPECT_NE(taken.problem, "");
  EXPECT_EQ(finder_.bytes(), 0u);
}

TEST_F(DepthLoopTest, ForwardsSumsAsUnitsOfOneNode) {
  EXPECT_TRUE(finder_.units(turn({}), 1, 0).empty());
  const ViewRequest request = turn(finder_.next(turn({}), kSurface, false));
  ASSERT_EQ(take(request).problem, "");
  ASSERT_EQ(take(request).problem, "") << "another node with the same payload";
  const std::vector<ByteBuffer> units = finder_.units(request, walls_.rig.hash(), 9);
  ASSERT_EQ(units.size(), 1u);
  DepthLoop root;
  EXPECT_EQ(root.take({units[0].data(), units[0].size()}, request).problem, "");
  const auto header = wire::parse_consistency_header({units[0].data(), units[0].size()});
  ASSERT_TRUE(header);
  EXPECT_EQ(header->node, 9u);
  EXPECT_EQ(header->sequence, request.sequence);
}

TEST_F(DepthLoopTest, PlaneModeReportsOnlyTheChangeToAPlane) {
  const DepthEstimator::Settings plane;
  EXPECT_FALSE(finder_.next(turn({}), plane, true));
  EXPECT_TRUE(finder_.next(turn({}), kSurface, true));
  const auto last = finder_.next(turn({}), plane, true);
  ASSERT_TRUE(last);
  EXPECT_TRUE(last->plan.hypotheses.empty());
  EXPECT_FALSE(last->gains.use);
  EXPECT_FALSE(finder_.next(turn({}), plane, true));
}

TEST_F(DepthLoopTest, UnusedEstimatesAreRare) {
  unsigned said = 0;
  for (unsigned i = 0; i < 2 * (DepthLoop::kRetryInterval + 1); i++)
    if (finder_.next(turn({}), kSurface, false)) {
      said++;
      finder_.set_accepted(false);
    }
  EXPECT_EQ(said, 2u);
}

// The sums of each request arrive two pictures late, or never.
TEST_F(DepthLoopTest, LateSumsAreUsed) {
  for (const bool arrive : {true, false}) {
    finder_.clear();
    std::deque<std::pair<uint32_t, ByteBuffer>> underway;
    std::optional<DepthEstimate> found;
    ViewRequest request;
    for (int i = 0; i < 60; i++) {
      request = turn(found);
      if (underway.size() > 2) {
        const auto [sequence, unit] = std::move(underway.front());
        underway.pop_front();
        if (arrive && !unit.empty()) {
          const DepthLoop::Taken taken = finder_.take({unit.data(), unit.size()}, request);
          EXPECT_EQ(taken.ahead, static_cast<int32_t>(sequence - request.sequence));
          EXPECT_EQ(taken.problem, "");
        }
      }
      underway.emplace_back(request.sequence, request.hypotheses.empty() ? ByteBuffer() : std::move(unit_));
      finder_.adapt_rate(false, 1);
      found = finder_.next(request, kSurface, false);
      ASSERT_TRUE(found);
      finder_.set_accepted(true);
    }
    EXPECT_EQ(finder_.state().rounds > 5, arrive);
    if (!arrive) continue;
    ASSERT_TRUE(request.view.focus.map);
    EXPECT_NEAR(request.view.focus.map->inverse_at(20, 60), 1 / 3., 0.05);
    EXPECT_NEAR(request.view.focus.map->inverse_at(140, 60), 1 / 1.5, 0.05);
  }
}

}  // namespace
}  // namespace lf
