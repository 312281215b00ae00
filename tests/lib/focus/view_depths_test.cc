// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/view_depths.h"

#include "focus/warp_depth_map.h"
#include "lib/focus/array_of_walls.h"
#include "support/test.h"
#include "wire/request_codec.h"

namespace lf {
namespace {

ViewRequest request_of(const View& view) {
  ViewRequest request;
  request.view = view;
  request.view.focus.map = nullptr;
  return request;
}

TEST(ViewDepths, FindsAndWarpsASurface) {
  const test::ArrayOfWalls walls;
  const FocusArray array(walls.rig);
  ViewDepths focus({FocusMode::kSurface, 1.2, 6});
  View view = walls.view(0);
  ViewRequest request;
  for (int i = 0; i < 10; i++) {
    view.pose.position.x += 0.001;
    request = request_of(view);
    focus.apply(request);
    EXPECT_EQ(request.hypotheses.empty(), i == 0);
    ViewDepths::Answers answers;
    if (i > 0) answers.moments = walls.moments(request.view, request.hypotheses, walls.own);
    focus.take(request, answers, array);
  }
  EXPECT_FALSE(request.on_plane);
  ASSERT_TRUE(request.view.focus.map);
  const FocalMap& map = *request.view.focus.map;
  EXPECT_NEAR(map.inverse_at(20, 60), 1 / 3., 0.05);
  EXPECT_NEAR(map.inverse_at(140, 60), 1 / 1.5, 0.05);

  ViewRequest next = request_of(view);
  focus.apply(next);
  EXPECT_FALSE(next.hypotheses.empty());
  next = request_of(view);
  focus.apply(next);
  EXPECT_TRUE(next.hypotheses.empty()) << "hypotheses are sent once";
  EXPECT_TRUE(next.view.focus.map);
}

TEST(ViewDepths, ViewsOfASetShareTheSurface) {
  const test::ArrayOfWalls walls;
  ViewRequest leader = request_of(walls.view(0));
  leader.view = walls.view(80);
  leader.hypotheses = {{DepthHypothesis::Kind::kPlane, 3}};
  leader.gains = {.use = true, .ask = true, .mean = {1}, .mean_of = 7};
  ViewRequest beside = leader;
  beside.view = offset_view(leader.view, 0.06);
  const View view = beside.view;
  apply_reference_view(leader, beside);
  EXPECT_TRUE(beside.hypotheses.empty());
  EXPECT_EQ(beside.gains, GainRequest{.use = true});
  ASSERT_TRUE(beside.view.focus.map);
  EXPECT_EQ(*beside.view.focus.map, *warp_depth_map(leader.view, view));
  leader.on_plane = true;
  apply_reference_view(leader, beside);
  EXPECT_FALSE(beside.view.focus.map) << "one plane for all";
  EXPECT_FALSE(beside.on_plane);
  EXPECT_EQ(beside.view.focus.plane, leader.view.focus.plane);
}

TEST(ViewDepths, PlaneNeedsAMapOnlyForHypotheses) {
  const test::ArrayOfWalls walls;
  DepthEstimator::Plan plan{.view = walls.view(80), .on_plane = true};
  plan.plane = plane_through({0, 0, 2}, {0, 0, -1});
  ViewRequest request = request_of(walls.view(0));
  apply_plan(plan, request);
  EXPECT_FALSE(request.view.focus.map);
  EXPECT_FALSE(request.on_plane);
  EXPECT_EQ(request.view.focus.plane, *plan.plane);
  request = request_of(walls.view(0));
  request.hypotheses = {{DepthHypothesis::Kind::kPlane, 3}};
  apply_plan(plan, request);
  EXPECT_TRUE(request.view.focus.map);
  EXPECT_TRUE(request.on_plane);
  request = request_of(walls.view(0));
  request.gains.mean = {1, 2, 3};
  request.view.width++;
  apply_plan(plan, request);
  EXPECT_TRUE(request.gains.mean.empty()) << "another size";
  EXPECT_FALSE(request.view.focus.map);
}

TEST(ViewDepths, TooLargeViewsUseThePlane) {
  const test::ArrayOfWalls walls;
  const DepthEstimator::Plan plan{.view = walls.view(80), .on_plane = true};
  ViewRequest request = request_of(walls.view(0));
  request.view.width = request.view.height = kMaxImageSize;
  request.hypotheses = {{DepthHypothesis::Kind::kPlane, 3}};
  request.gains.ask = true;
  apply_plan(plan, request);
  EXPECT_FALSE(request.view.focus.map);
  EXPECT_FALSE(request.on_plane);
  EXPECT_NO_THROW(wire::encode_request(request));
}

TEST(ViewDepths, GainsAreRequestedAndReturned) {
  ExposureSchedule turns;
  PhotoConsistency nothing, mean;
  mean.reset(2, 2);
  EXPECT_EQ(next_gains(turns, false, true, mean, {}, 4), GainRequest{});
  EXPECT_FALSE(next_gains(turns, true, false, nothing, {}, 4).ask) << "no hypotheses";
  EXPECT_TRUE(next_gains(turns, true, true, nothing, {}, 4).ask);
  EXPECT_FALSE(next_gains(turns, true, true, nothing, {}, 5).ask) << "one at a time";
  const GainRequest came = next_gains(turns, true, true, mean, {}, 6);
  EXPECT_EQ(came.mean.size(), 4u);
  EXPECT_EQ(came.mean_of, 6u);
}

}  // namespace

}  // namespace lf
