// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/depth_feedback.h"

#include "focus/depth_selection.h"
#include "lib/focus/array_of_walls.h"
#include "support/test.h"

namespace lf {
namespace {

using WaitResult = DepthFeedback::WaitResult;
constexpr std::chrono::milliseconds kShort{5};

class DepthFeedbackTest : public testing::Test {
 protected:
  ViewRequest request() const {
    ViewRequest request;
    request.view_id = 3;
    request.view = walls_.view(0);
    request.view.focus.map = nullptr;
    return request;
  }
  DepthEstimate found(uint32_t sequence) const {
    DepthEstimate focus{.sequence = sequence, .plan = {.view = walls_.view(0)}, .gains = {}};
    View& view = focus.plan.view;
    view.focus.map = test::level_surface(view.width, view.height, 0.5, 0.5, 0,
                                         plane_through(view.pose.position, view.pose.forward()));
    focus.plan.hypotheses = {{DepthHypothesis::Kind::kPlane, 3}};
    return focus;
  }

  test::ArrayOfWalls walls_;
  DepthFeedback feedback_;
};

TEST_F(DepthFeedbackTest, NextRequestHasTheSurfaceAndHypothesesOnce) {
  ViewRequest next = request();
  feedback_.apply(next);
  EXPECT_FALSE(next.view.focus.map) << "nothing is known yet";
  feedback_.announce(found(1));
  feedback_.apply(next);
  EXPECT_TRUE(next.view.focus.map);
  EXPECT_EQ(next.hypotheses.size(), 1u);
  next = request();
  feedback_.apply(next);
  EXPECT_TRUE(next.view.focus.map);
  EXPECT_TRUE(next.hypotheses.empty());
  feedback_.clear();
  next = request();
  feedback_.apply(next);
  EXPECT_FALSE(next.view.focus.map);
}

TEST_F(DepthFeedbackTest, OneViewOfASetHasHypotheses) {
  feedback_.announce(found(1));
  const ViewSet set{.layout = ViewSetLayout::kStereo};
  ViewRequest right = request(), left = request();
  right.place = set.place(1);
  left.place = set.place(0);
  feedback_.apply(right);
  EXPECT_TRUE(right.view.focus.map);
  EXPECT_TRUE(right.hypotheses.empty());
  feedback_.apply(left);
  EXPECT_EQ(left.hypotheses.size(), 1u);
}

// The pointer's view may differ from the view of the surface, so that the same place has different pixels.
TEST_F(DepthFeedbackTest, PlaceBelongsToTheViewThatShowsIt) {
  DepthEstimate news = found(1);
  news.plan.view = walls_.view(0);
  ASSERT_TRUE(news.plan.view.focus.map);
  FocalMap map = *news.plan.view.focus.map;
  map.farthest = 1 / 3.0;
  map.nearest = 1 / 1.5;
  for (int j = 0; j < map.rows; j++)
    for (int i = 0; i < map.columns; i++)
      map.levels[static_cast<size_t>(j) * map.columns + i] = i < map.columns / 2 ? 0 : 255;
  news.plan.view.focus.map = std::make_shared<const FocalMap>(map);
  feedback_.announce(news);
  // The near half begins at the centre; from 0.3 m farther right it begins farther left.
  const View seen = offset_view(news.plan.view, 0.3);
  const Vec2 place(0.4, 0.5);
  ASSERT_NEAR(*feedback_.focus_at(place), 3, 0.2);
  EXPECT_NEAR(*feedback_.focus_at(place, &seen), 1.5, 0.1);
}

// In bursts of pictures, several results arrive before the next request.
TEST_F(DepthFeedbackTest, SearchHypothesesAreQueued) {
  const auto sweep_at = [](int16_t level) {
    return std::vector<DepthHypothesis>(kSweep, {DepthHypothesis::Kind::kPlane, level});
  };
  const auto hypotheses_of_next = [&] {
    ViewRequest next = request();
    feedback_.apply(next);
    return next.hypotheses;
  };
  DepthEstimate news = found(1);
  for (const int16_t level : {1, 2}) {
    news.plan.hypotheses = sweep_at(level);
    feedback_.announce(news);
  }
  news.plan.hypotheses.clear();
  feedback_.announce(news);
  EXPECT_TRUE(feedback_.has_hypotheses());
  EXPECT_EQ(hypotheses_of_next(), sweep_at(1));
  EXPECT_EQ(hypotheses_of_next(), sweep_at(2));
  EXPECT_TRUE(hypotheses_of_next().empty());

  const DepthEstimate better = found(2);
  for (int i = 0; i < 2; i++) feedback_.announce(better);
  EXPECT_EQ(hypotheses_of_next(), better.plan.hypotheses);
  EXPECT_TRUE(hypotheses_of_next().empty()) << "only the latest refinement";

  news.plan.hypotheses = sweep_at(3);
  feedback_.announce(news);
  DepthEstimate other = found(3);
  FocalMap map = *other.plan.view.focus.map;
  map.nearest = 2;
  other.plan.view.focus.map = std::make_shared<const FocalMap>(map);
  feedback_.announce(other);
  EXPECT_EQ(hypotheses_of_next(), other.plan.hypotheses) << "the levels have a new range";
  EXPECT_TRUE(hypotheses_of_next().empty());

  news.plan.hypotheses = sweep_at(4);
  for (int i = 0; i < 100; i++) feedback_.announce(news);
  int most = 0;
  while (!hypotheses_of_next().empty()) most++;
  EXPECT_LE(most, 8);
  EXPECT_GT(most, 1);
}

TEST_F(DepthFeedbackTest, WaitsForTheEstimateOfARequest) {
  EXPECT_EQ(feedback_.wait_for(0xffffffff, kShort), WaitResult::kTimeout);
  std::thread compositor([&] { feedback_.announce(found(1)); });
  EXPECT_EQ(feedback_.wait_for(0xffffffff, std::chrono::minutes(1)), WaitResult::kAvailable)
      << "numbers wrap: 1 is later";
  compositor.join();
  EXPECT_EQ(feedback_.wait_for(2, kShort), WaitResult::kTimeout);
  feedback_.set_unlocked(true);
  EXPECT_EQ(feedback_.wait_for(1, kShort), WaitResult::kUnlocked);
}

TEST_F(DepthFeedbackTest, FocusesAtOnceWithASurface) {
  feedback_.announce(found(1));
  const std::optional<double> distance = feedback_.focus_at({0.5, 0.5});
  ASSERT_TRUE(distance);
  EXPECT_NEAR(*distance, 2, 1e-3);
  EXPECT_FALSE(feedback_.next_sweep(request(), &walls_.rig)) << "no search active";
}

TEST_F(DepthFeedbackTest, SweepsWithoutASurface) {
  EXPECT_FALSE(feedback_.next_sweep(request(), &walls_.rig));
  EXPECT_FALSE(feedback_.focus_at({0.25, 0.5}));
  for (uint32_t stage = 0; stage < 2; stage++) {
    const std::optional<ViewRequest> sweep = feedback_.next_sweep(request(), &walls_.rig);
    ASSERT_TRUE(sweep) << stage;
    EXPECT_TRUE(sweep->probe);
    EXPECT_FALSE(sweep->hypotheses.empty());
    EXPECT_LT(sweep->view.width, request().view.width);
    feedback_.sweep_sent(10 + stage);
    EXPECT_FALSE(feedback_.next_sweep(request(), &walls_.rig)) << "one at a time";
    EXPECT_FALSE(feedback_.take_found());
    feedback_.announce(found(10 + stage));
  }
  const std::optional<double> distance = feedback_.take_found();
  ASSERT_TRUE(distance);
  EXPECT_NEAR(*distance, 2, 1e-3);
  EXPECT_FALSE(feedback_.take_found()) << "once";
}

TEST_F(DepthFeedbackTest, LostSweepsEndTheSearch) {
  feedback_.focus_at({0.5, 0.5});
  int sweeps = 0;
  for (int i = 0; i < 1000; i++)
    if (feedback_.next_sweep(request(), &walls_.rig)) feedback_.sweep_sent(static_cast<uint32_t>(++sweeps));
  EXPECT_EQ(sweeps, 3);
}

TEST_F(DepthFeedbackTest, RelayAddsSurfacesToRequests) {
  RelayedDepths relayed;
  ViewRequest passing = request();
  EXPECT_FALSE(relayed.apply(passing));
  relayed.announce(3, found(1));
  EXPECT_TRUE(relayed.apply(passing));
  EXPECT_TRUE(passing.view.focus.map);
  EXPECT_FALSE(relayed.apply(passing)) << "has its own surface";
  ViewRequest probe = request();
  probe.probe = true;
  EXPECT_FALSE(relayed.apply(probe));
  ViewRequest other = request();
  other.view_id = 4;
  EXPECT_FALSE(relayed.apply(other)) << "another viewer";
  relayed.clear();
  passing = request();
  EXPECT_FALSE(relayed.apply(passing));
}

}  // namespace
}  // namespace lf
