// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/focus_control.h"

#include <gtest/gtest.h>

#include <deque>

#include "lib/focus/array_of_walls.h"

namespace lf {
namespace {

using test::ArrayOfWalls;

const Plane kFrom{{0, 0, 1}, 0};

// One view of an array under the control, request after request.
struct Loop {
  Loop(FocusMode mode, bool flat, double near = 1.2, double far = 6) : walls(flat), control({mode, near, far}) {
    request.view = walls.view(0);
    request.view.focus.map = nullptr;
  }
  void run(int requests) {
    for (int i = 0; i < requests; i++) {
      std::vector<Moments> moments;
      if (!request.trials.empty()) moments = walls.moments(request.view, request.trials, walls.own);
      trials += request.trials.size();
      const FocusControl::Plan plan = control.next(request, moments, kFrom);
      request.view = plan.view;
      request.trials = plan.trials;
    }
  }
  // Share of the nodes within a tenth of the distance they should be at.
  double right() const {
    const FocalMap& map = *request.view.focus.map;
    int good = 0, all = 0;
    for (int j = 0; j < map.rows; j++)
      for (int i = 0; i < map.columns; i++) {
        const double u = (*request.view.lens.unproject({4 * i + 1.5, 4 * j + 1.5})).x;
        const double x = request.view.pose.position.x + 1.5 / walls.nearer * u, distance = walls.nearer / map.inverse_of(map.levels[j * 40 + i]);
        if (!walls.is_flat && std::abs(x) < 0.06) continue;  // at the edge
        all++;
        good += std::abs(distance / (!walls.is_flat && x > 0 ? 1.5 : 3) - 1) < 0.1;
      }
    return static_cast<double>(good) / all;
  }
  ArrayOfWalls walls;
  FocusControl control;
  ViewRequest request;
  size_t trials = 0;
};

TEST(FocusControl, LeavesAPlaneAlone) {
  Loop loop(FocusMode::kPlane, false);
  loop.run(3);
  EXPECT_EQ(loop.request.view.focus.map, nullptr);
  EXPECT_EQ(loop.trials, 0u);
}

TEST(FocusControl, BeginsOnTheViewersPlane) {
  Loop loop(FocusMode::kSurface, false);
  loop.run(1);
  const FocalMap& map = *loop.request.view.focus.map;
  for (const uint8_t level : map.levels) EXPECT_NEAR(1 / map.inverse_of(level), 3, 0.03);
  EXPECT_NEAR(1 / map.nearest, 1.2, 1e-12);
  EXPECT_NEAR(1 / map.farthest, 6, 1e-12);
  EXPECT_FALSE(loop.request.trials.empty());
  EXPECT_NO_THROW(validate(loop.request.view));
}

TEST(FocusControl, FindsTwoWallsWithinADozenRounds) {
  for (const FocusMode mode : {FocusMode::kSurface, FocusMode::kAuto}) {
    Loop loop(mode, false);
    loop.run(14);
    EXPECT_GT(loop.right(), 0.97);
    EXPECT_FALSE(loop.control.state().flat);
  }
}

TEST(FocusControl, RestsWhereThereIsNothingMoreToFind) {
  Loop loop(FocusMode::kAuto, true);
  loop.run(60);
  EXPECT_EQ(loop.control.state().interval, FocusControl::kLongestFlatRest);
  EXPECT_TRUE(loop.control.state().flat);
  const std::vector<uint8_t>& levels = loop.request.view.focus.map->levels;
  EXPECT_EQ(std::ranges::adjacent_find(levels, std::not_equal_to<>()), levels.end()) << "one plane";
  EXPECT_GT(loop.right(), 0.99);
  const size_t before = loop.trials;
  loop.run(64);
  EXPECT_LE(loop.trials - before, 20u) << "four requests of five trials";
}

TEST(FocusControl, WakesUpWhenTheSceneChanges) {
  Loop loop(FocusMode::kAuto, true);
  loop.run(60);
  loop.walls = ArrayOfWalls(false);
  loop.run(2 * FocusControl::kLongestFlatRest + 14);
  EXPECT_GT(loop.right(), 0.97);
}

TEST(FocusControl, AFlatSceneEndsWithNextToNoTrials) {
  Loop loop(FocusMode::kAuto, true);
  loop.run(30);
  EXPECT_TRUE(loop.control.state().flat);
  loop.trials = 0;
  loop.run(64);
  // A trial is at most a 16th of the samples of the picture, in as many bits: 2 % are 20 trials.
  EXPECT_LE(loop.trials, 0.02 * 64 * 16);
  EXPECT_NEAR(loop.control.state().bought, 0, FocusControl::kFlatEnough) << "and a surface would buy nothing";
}

TEST(FocusControl, TellsWhatASurfaceBought) {
  Loop loop(FocusMode::kSurface, false);
  loop.run(20);
  EXPECT_GT(loop.control.state().bought, 1);
  EXPECT_EQ(loop.control.state().trials, 4u);
}

TEST(FocusControl, TheRangeOfDepthsFollowsTheScene) {
  for (const FocusMode mode : {FocusMode::kSurface, FocusMode::kAuto}) {
    Loop loop(mode, false, 0, 0);
    loop.run(1);
    EXPECT_NEAR(loop.control.state().near, 1.2, 1e-9) << "0.4 times the viewer's focus distance";
    EXPECT_NEAR(loop.control.state().far, 12, 1e-9);
    loop.run(30);
    EXPECT_GT(loop.right(), 0.97);
    EXPECT_LT(loop.control.state().near, 1.5);
    EXPECT_GT(loop.control.state().far, 3);
    EXPECT_EQ(loop.control.state().looks, 0u);
  }
  Loop flat(FocusMode::kAuto, true, 0, 0);
  flat.run(30);
  EXPECT_NEAR(flat.control.state().near, 2, 0.1) << "3 m, and half as near again";
  EXPECT_NEAR(flat.control.state().far, 4.5, 0.2);
}

TEST(FocusControl, FindsASceneThatLeftTheRange) {
  for (const FocusMode mode : {FocusMode::kSurface, FocusMode::kAuto}) {
    for (const double nearer : {3., 0.4}) {
      SCOPED_TRACE(nearer);
      Loop loop(mode, false, 0, 0);
      loop.run(30);
      loop.walls = ArrayOfWalls(false, nearer);
      loop.run(60);
      EXPECT_GT(loop.right(), 0.95);
      EXPECT_GE(loop.control.state().looks, 1u);
    }
  }
}

// What comes of a request shapes the one that leaves `underway` requests later, as where pictures take that long.
struct DelayedLoop : Loop {
  DelayedLoop(FocusMode mode, size_t underway) : Loop(mode, false, 0, 0), requests(underway, request) {}
  void run_delayed(size_t count) {
    for (size_t i = 0; i < count; i++) {
      request = requests.front();
      requests.pop_front();
      run(1);
      requests.push_back(request);
    }
  }
  // Of all surfaces that are underway.
  double least_right() {
    double least = 1;
    for (const ViewRequest& r : requests) {
      request = r;
      least = std::min(least, right());
    }
    return least;
  }
  std::deque<ViewRequest> requests;
};

TEST(FocusControl, ManyRequestsUnderwayMakeOneSurface) {
  for (const FocusMode mode : {FocusMode::kSurface, FocusMode::kAuto})
    for (const size_t underway : {1, 2, 3, 4, 8, 16}) {
      SCOPED_TRACE(underway);
      DelayedLoop loop(mode, underway);
      loop.run_delayed(14 + 3 * underway);
      for (int i = 0; i < 20; i++) {
        EXPECT_GT(loop.least_right(), 0.97) << i;
        loop.run_delayed(1);
      }
      EXPECT_EQ(loop.control.state().looks, 0u);
    }
}

TEST(FocusControl, FindsASceneThatLeftTheRangeWithManyRequestsUnderway) {
  for (const FocusMode mode : {FocusMode::kSurface, FocusMode::kAuto})
    for (const size_t underway : {2, 3, 4, 8})
      for (const double nearer : {3., 0.4}) {
        SCOPED_TRACE(std::to_string(underway) + " underway, " + std::to_string(nearer) + " times nearer");
        DelayedLoop loop(mode, underway);
        loop.run_delayed(30 + 3 * underway);
        loop.walls = ArrayOfWalls(false, nearer);
        loop.run_delayed(60 + 6 * underway);
        EXPECT_GT(loop.least_right(), 0.95);
        const FocusControl::State& state = loop.control.state();
        EXPECT_GE(state.looks, 1u);
        EXPECT_LE(state.looks, FocusControl::kMostLooks) << "not one for each request underway";
        EXPECT_LT(state.near, 1.5 / nearer);
        EXPECT_GT(state.far, 3 / nearer);
      }
}

TEST(FocusControl, KeepsTheRangeItWasTold) {
  Loop loop(FocusMode::kSurface, false);
  loop.run(20);
  loop.walls = ArrayOfWalls(false, 3);
  loop.run(20);
  EXPECT_NEAR(loop.control.state().near, 1.2, 1e-12);
  EXPECT_NEAR(loop.control.state().far, 6, 1e-12);
}

}  // namespace
}  // namespace lf
