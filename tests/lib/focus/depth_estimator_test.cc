// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/depth_estimator.h"

#include <climits>
#include <deque>

#include "lib/focus/array_of_walls.h"
#include "support/test.h"

namespace lf {
namespace {

using test::ArrayOfWalls;

struct Loop {
  Loop(FocusMode mode, bool flat, double near = 1.2, double far = 6)
      : walls(flat), array(walls.rig), control({mode, near, far}), is_automatic(near == 0) {
    request.view = walls.view(0);
    request.view.focus.map = nullptr;
    viewers = request.view;
  }
  void focus(double distance) {
    viewers.focus.plane = request.view.focus.plane = plane_through({0, 0, distance}, {0, 0, -1});
  }
  void look_from(const Vec3& eye) { viewers.pose.position = request.view.pose.position = eye; }
  void run(int requests) {
    for (int i = 0; i < requests; i++) {
      std::vector<PhotoConsistency> moments;
      if (!request.hypotheses.empty() && !loses)
        moments = walls.moments(request.view, request.hypotheses, walls.own, request.out_of_service);
      hypotheses += request.hypotheses.size();
      request.sequence++;
      const DepthEstimator::Plan plan = control.next(request, moments, array);
      // Omits the surface if no picture and no hypothesis needs the map, as lfviewrequest does.
      request.view = viewers;
      request.out_of_service = out_of_service;
      request.hypotheses = plan.hypotheses;
      if (drops && !request.hypotheses.empty()) {  // lost in transit: the next request arrives instead
        request.hypotheses.clear();
        request.sequence++;
        dropped++;
        if (dropped == drops) drops = 0;
      }
      request.on_plane = plan.on_plane && !plan.hypotheses.empty();
      if (!plan.on_plane || request.on_plane) request.view.focus.map = plan.view.focus.map;
      if (plan.plane) request.view.focus.plane = *plan.plane;
      if (plan.view.focus.map) {
        surface = plan.view;
        EXPECT_NO_THROW(validate(surface));
        if (is_automatic) {
          EXPECT_LE(surface.focus.map->nearest, array.nearest() + 1e-9) << "within the array's resolution";
        }
      }
    }
  }
  bool shows_surface() const { return displayed_view(request).focus.map != nullptr; }
  // Returns the fraction of nodes within a tenth of their true distance.
  double right() const {
    const FocalMap& map = *surface.focus.map;
    int good = 0, all = 0;
    for (int j = 0; j < map.rows; j++)
      for (int i = 0; i < map.columns; i++) {
        const double middle = (map.step - 1) / 2.;
        const double u = (*surface.lens.unproject({map.step * i + middle, map.step * j + middle})).x;
        const double x = surface.pose.position.x + 1.5 / walls.nearer * u;
        const double distance = walls.nearer / map.inverse_of(map.levels[j * map.columns + i]);
        if (!walls.is_flat && std::abs(x) < 0.06) continue;  // at the depth edge
        all++;
        good += std::abs(distance / (!walls.is_flat && x > 0 ? 1.5 : 3) - 1) < 0.1;
      }
    return static_cast<double>(good) / all;
  }
  ArrayOfWalls walls;
  FocusArray array;
  DepthEstimator control;
  bool is_automatic;
  View viewers;
  CameraSet out_of_service;
  ViewRequest request;
  View surface;
  size_t hypotheses = 0;
  bool loses = false;  // photo-consistency sums are lost
  int drops = 0;       // number of following requests with hypotheses to drop
  int dropped = 0;
};

// Nodes closer together than camera pixels cost as much and give no information.
TEST(DepthEstimator, NodesOfALargeViewAreFartherApart) {
  for (const auto& [times, step] : {std::pair{1., 4}, {3.9, 4}, {4.1, 8}, {8.2, 16}}) {
    Loop loop(FocusMode::kSurface, false);
    const double larger = times * loop.array.focal() / loop.viewers.lens.fx();
    View& view = loop.viewers;
    view.width = static_cast<int>(std::lround(larger * view.width));
    view.height = static_cast<int>(std::lround(larger * view.height));
    view.lens = Lens::from_fov_y(25, view.width, view.height);
    loop.request.view = view;
    loop.run(12);
    ASSERT_TRUE(loop.surface.focus.map) << times;
    EXPECT_EQ(loop.surface.focus.map->step, step) << times;
    EXPECT_GT(loop.right(), 0.95) << times;
  }
}

TEST(DepthEstimator, KeepsAPlane) {
  Loop loop(FocusMode::kPlane, false);
  loop.run(3);
  EXPECT_EQ(loop.request.view.focus.map, nullptr);
  EXPECT_EQ(loop.hypotheses, 0u);
}

TEST(DepthEstimator, StartsOnTheViewersPlane) {
  Loop loop(FocusMode::kSurface, false);
  loop.run(1);
  EXPECT_FALSE(loop.shows_surface());
  const FocalMap& map = *loop.surface.focus.map;
  for (const uint8_t level : map.levels) EXPECT_NEAR(1 / map.inverse_of(level), 3, 0.03);
  EXPECT_NEAR(1 / map.nearest, 1.2, 1e-12);
  EXPECT_NEAR(1 / map.farthest, 6, 1e-12);
  EXPECT_FALSE(loop.request.hypotheses.empty());
  EXPECT_NO_THROW(validate(loop.request.view));
}

TEST(DepthEstimator, FindsTwoWallsWithinADozenRounds) {
  for (const FocusMode mode : {FocusMode::kSurface, FocusMode::kAuto}) {
    Loop loop(mode, false);
    loop.run(14);
    EXPECT_GT(loop.right(), 0.97);
    EXPECT_TRUE(loop.shows_surface());
    EXPECT_FALSE(loop.control.state().flat);
  }
}

// When a pipeline starts on a busy machine, nodes answer the first requests too late.
TEST(DepthEstimator, LostSearchRequestsAreRepeated) {
  for (const bool automatic : {true, false})
    for (const int lost : {2, 5}) {
      SCOPED_TRACE(lost);
      Loop loop = automatic ? Loop(FocusMode::kSurface, false, 0, 0) : Loop(FocusMode::kSurface, false);
      loop.loses = true;
      loop.run(lost);
      loop.loses = false;
      loop.run(16);
      EXPECT_GT(loop.right(), 0.97);
      EXPECT_TRUE(loop.shows_surface());
    }
}

// Requests can be dropped by a full queue, or by a compositor that skips late requests.
TEST(DepthEstimator, DroppedSearchRequestsAreRepeated) {
  for (const bool automatic : {true, false}) {
    Loop loop = automatic ? Loop(FocusMode::kSurface, false, 0, 0) : Loop(FocusMode::kSurface, false);
    loop.run(2);
    loop.drops = 3;
    loop.run(60);
    EXPECT_EQ(loop.dropped, 3);
    EXPECT_GT(loop.right(), 0.97);
    EXPECT_TRUE(loop.shows_surface());
  }
}

TEST(DepthEstimator, RecoversSoonAfterAnOverload) {
  Loop loop(FocusMode::kSurface, false, 0, 0);
  loop.control.set_min_interval(8);
  loop.loses = true;
  loop.run(3000);
  loop.loses = false;
  loop.run(300);
  EXPECT_GT(loop.right(), 0.9);
  EXPECT_TRUE(loop.shows_surface());
}

// A busy machine runs fewer rounds; the resting scene must not reduce them further.
TEST(DepthEstimator, OverloadDoesNotProlongTheRest) {
  Loop loop(FocusMode::kAuto, false);
  loop.run(100);
  ASSERT_EQ(loop.control.state().interval, DepthEstimator::kLongestRest);
  loop.control.set_min_interval(8);
  const unsigned before = loop.control.state().rounds;
  loop.run(80);
  EXPECT_GE(loop.control.state().rounds - before, 9u);
}

TEST(DepthEstimator, PermanentLossesIncreaseTheInterval) {
  Loop loop(FocusMode::kSurface, false, 0, 0);
  loop.loses = true;
  loop.run(200);
  loop.hypotheses = 0;
  loop.run(400);
  EXPECT_LT(loop.hypotheses, 400u * 4);
}

TEST(DepthEstimator, RestsWhenNothingImproves) {
  Loop loop(FocusMode::kAuto, true);
  loop.run(60);
  EXPECT_EQ(loop.control.state().interval, DepthEstimator::kLongestFlatRest);
  EXPECT_TRUE(loop.control.state().flat);
  const std::vector<uint8_t>& levels = loop.surface.focus.map->levels;
  EXPECT_EQ(std::ranges::adjacent_find(levels, std::not_equal_to<>()), levels.end()) << "one plane";
  EXPECT_GT(loop.right(), 0.99);
  const size_t before = loop.hypotheses;
  loop.run(64);
  EXPECT_LE(loop.hypotheses - before, 20u) << "four requests of five hypotheses";
}

TEST(DepthEstimator, WakesUpWhenTheSceneChanges) {
  Loop loop(FocusMode::kAuto, true);
  loop.run(60);
  loop.walls = ArrayOfWalls(false);
  loop.run(2 * DepthEstimator::kLongestFlatRest + 14);
  EXPECT_GT(loop.right(), 0.97);
}

TEST(DepthEstimator, FlatSceneNeedsFewHypotheses) {
  Loop loop(FocusMode::kAuto, true);
  loop.run(30);
  EXPECT_TRUE(loop.control.state().flat);
  loop.hypotheses = 0;
  loop.run(64);
  // A hypothesis costs at most a 16th of the picture's samples, at the same number of bits: 2 % are 20 hypotheses.
  EXPECT_LE(loop.hypotheses, 0.02 * 64 * 16);
  EXPECT_NEAR(loop.control.state().over_plane, 0, DepthEstimator::kFlatEnough) << "no gain from a surface";
}

TEST(DepthEstimator, ReportsTheAdvantageOfTheSurface) {
  Loop loop(FocusMode::kSurface, false);
  loop.run(20);
  EXPECT_GT(loop.control.state().over_plane, 1);
  EXPECT_EQ(loop.control.state().hypotheses, 4u);
}

TEST(DepthEstimator, DepthRangeFollowsTheScene) {
  for (const FocusMode mode : {FocusMode::kSurface, FocusMode::kAuto}) {
    Loop loop(mode, false, 0, 0);
    loop.run(1);
    EXPECT_NEAR(loop.control.state().near, 1 / loop.array.nearest(), 1e-9) << "full range of the array";
    EXPECT_EQ(loop.control.state().far, std::numeric_limits<double>::infinity());
    loop.run(30);
    EXPECT_GT(loop.right(), 0.97);
    EXPECT_LT(loop.control.state().near, 1.5);
    EXPECT_GT(loop.control.state().far, 3);
    EXPECT_EQ(loop.control.state().scene_changes, 0u);
  }
  Loop flat(FocusMode::kAuto, true, 0, 0);
  flat.run(30);
  const double near = 1 / flat.control.state().near, far = 1 / flat.control.state().far;
  EXPECT_LT((near - far) * flat.array.disparity(), 255 / 16. + 0.1) << "levels need be no finer than 1/16 pixel";
  EXPECT_GT(near, 1.4 / 3) << "1.5 times as near";
  EXPECT_LT(far, 1 / 4.5);
}

TEST(DepthEstimator, WithoutARigThePlaneDeterminesTheRange) {
  Loop loop(FocusMode::kSurface, false, 0, 0);
  loop.array = Plane{{0, 0, 1}, 0};
  loop.is_automatic = false;
  loop.run(1);
  EXPECT_NEAR(loop.control.state().near, DepthEstimator::kNearest * 3, 1e-9);
  loop.run(30);
  EXPECT_GT(loop.right(), 0.97);
}

TEST(DepthEstimator, FindsTheSurfaceFromADistantPlane) {
  for (const FocusMode mode : {FocusMode::kSurface, FocusMode::kAuto})
    for (const double too_far : {1 / 40., 1 / 5., 1., 5., 40.}) {
      SCOPED_TRACE(std::to_string(too_far) + " times as far");
      Loop loop(mode, false, 0, 0);
      loop.focus(3 * too_far);
      loop.run(15);
      EXPECT_GT(loop.right(), 0.97);
      EXPECT_TRUE(loop.shows_surface());
      loop.run(40);
      EXPECT_GT(loop.right(), 0.97);
      EXPECT_TRUE(loop.shows_surface());
      EXPECT_EQ(loop.control.state().scene_changes, 0u);
    }
}

// The plane is far too near or too far; few hypotheses must suffice.
TEST(DepthEstimator, FindsAFlatSceneFromADistantPlane) {
  for (const double too_far : {1 / 40., 1 / 5., 5., 40.}) {
    SCOPED_TRACE(std::to_string(too_far) + " times as far");
    Loop loop(FocusMode::kAuto, true, 0, 0);
    loop.focus(3 * too_far);
    loop.run(60);
    EXPECT_GT(loop.right(), 0.99);
    if (!loop.shows_surface()) {
      const Plane shown = displayed_view(loop.request).focus.plane;
      EXPECT_NEAR(-shown.normal.z / shown.d, 1 / 3., 0.5 / loop.array.disparity()) << "to half a pixel";
    }
    const size_t before = loop.hypotheses;
    loop.run(64);
    EXPECT_LE(loop.hypotheses - before, 64u / DepthEstimator::kLongestRest * 5);
  }
}

TEST(DepthEstimator, SingleCameraKeepsThePlane) {
  for (const FocusMode mode : {FocusMode::kSurface, FocusMode::kAuto}) {
    Loop loop(mode, false, 0, 0);
    const Rig one = scene_rig(1, 1, 160, 120);
    loop.array = FocusArray(one);
    for (int i = 0; i < 30; i++) {
      loop.run(1);
      EXPECT_EQ(loop.request.view.focus.map, nullptr);
    }
    EXPECT_EQ(loop.hypotheses, 0u);
  }
}

TEST(DepthEstimator, OneCameraInServiceShowsThePlane) {
  for (const FocusMode mode : {FocusMode::kSurface, FocusMode::kAuto}) {
    Loop loop(mode, false, 0, 0);
    loop.run(20);
    EXPECT_TRUE(loop.shows_surface());
    for (CameraIndex i = 0; i < loop.walls.rig.cameras.size(); i++)
      if (i != 4) loop.out_of_service.push_back(i);
    loop.run(2);
    for (int i = 0; i < 40; i++) {
      loop.run(1);
      EXPECT_FALSE(loop.shows_surface()) << i;
    }
  }
}

TEST(DepthEstimator, ViewpointAtACameraShowsThePlane) {
  for (const FocusMode mode : {FocusMode::kSurface, FocusMode::kAuto})
    for (const double beside : {0., 0.0005}) {
      Loop loop(mode, false, 0, 0);
      loop.look_from(loop.walls.rig.cameras[4].pose.position + Vec3(beside, 0, 0));
      for (int i = 0; i < 100; i++) {
        loop.run(1);
        ASSERT_FALSE(loop.shows_surface()) << i << ", " << beside;
      }
      loop.look_from({0.013, -0.017, 0});
      loop.run(40);
      EXPECT_TRUE(loop.shows_surface());
      EXPECT_GT(loop.right(), 0.97);
    }
}

// Photo-consistency sums of a scene at two depths; at most nodes, another depth far outside the scene fits equally
// well.
struct MisleadingScene {
  static constexpr double kLeft = 1 / 3., kRight = 1 / 1.5;  // 1/m
  double misleading, disparity;

  PhotoConsistency moments(const View& view, const DepthHypothesis& hypothesis) const {
    const FocalMap& map = *view.focus.map;
    const std::vector<uint8_t> levels = hypothesis_levels(view, hypothesis);
    PhotoConsistency out;
    out.reset(map.columns, map.rows);
    for (size_t i = 0; i < levels.size(); i++) {
      const int x = static_cast<int>(i) % map.columns, y = static_cast<int>(i) / map.columns;
      const double inverse = map.inverse_of(levels[i]), truth = 2 * x < map.columns ? kLeft : kRight;
      const double off = disparity * std::abs(inverse - truth), elsewhere = disparity * std::abs(inverse - misleading);
      const int bright = (x + y) % 2 == 0 ? 120 : 80;
      double luma = 100, deviation = std::min(30., 2 + off);
      if (off < 10) luma = bright;
      if (elsewhere < 3 && y % 10 < 7) {
        luma = 200 - bright;
        deviation = 2;
      }
      out.weight[i] = PhotoConsistency::kWeightOne;
      out.luma[i] = static_cast<uint16_t>(std::lround(luma * PhotoConsistency::kLumaOne));
      out.square[i] = static_cast<uint16_t>(std::lround(luma * luma + deviation * deviation));
    }
    return out;
  }
};

// By chance, some of the many planes of a search fit. They must not cast doubt on the scene once it is found.
TEST(DepthEstimator, DepthsOutsideTheSceneAreDiscarded) {
  const ArrayOfWalls walls;
  const FocusArray array(walls.rig);
  const MisleadingScene scene{0.8 * array.nearest(), array.disparity()};
  DepthEstimator control({.mode = FocusMode::kSurface});
  ViewRequest request;
  request.view = walls.view(0);
  request.view.focus = {.plane = plane_through({0, 0, 20}, {0, 0, -1})};
  bool tried = false;
  for (int i = 0; i < 20; i++) {
    std::vector<PhotoConsistency> moments;
    for (const DepthHypothesis& hypothesis : request.hypotheses) {
      moments.push_back(scene.moments(request.view, hypothesis));
      if (hypothesis.kind != DepthHypothesis::Kind::kPlane) continue;
      tried = tried ||
              std::abs(request.view.focus.map->inverse_of(hypothesis.value) - scene.misleading) < 3 / scene.disparity;
    }
    request.sequence++;
    const DepthEstimator::Plan plan = control.next(request, moments, array);
    request.view = plan.view;
    request.hypotheses = plan.hypotheses;
  }
  EXPECT_TRUE(tried) << "tried in the search";
  EXPECT_NEAR(1 / control.state().near, 1.5 * MisleadingScene::kRight, 0.5);
  EXPECT_FALSE(control.state().on_plane);
}

// An array with a wide baseline in front of a wall at 20 m and, in the right half of the view, a wall at 1.5 m. Its
// cameras may measure the surface themselves.
class WideArrayTest : public testing::Test {
 protected:
  static constexpr double kLeft = 1 / 20., kRight = 1 / 1.5;  // 1/m
  static constexpr auto kMeasured = DepthHypothesis::Kind::kMeasured;

  WideArrayTest() {
    request_.view = ArrayOfWalls().view(0);
    request_.view.pose.position = {0.02, -0.03, 0};
    request_.view.focus = {.plane = plane_through({0, 0, 20}, {0, 0, -1})};
  }

  static Rig wide_rig() {
    Rig rig = ArrayOfWalls().rig;
    const double factor = FocusArray(rig).nearest() / (1.05 * kRight);
    for (Camera& camera : rig.cameras) camera.pose.position *= factor;
    return rig;
  }
  double truth(const FocalMap& map, size_t node) const {
    return 2 * static_cast<int>(node % map.columns) < map.columns ? kLeft : right_;
  }
  PhotoConsistency consistency(const DepthHypothesis& hypothesis) const {
    const FocalMap& map = *request_.view.focus.map;
    PhotoConsistency out;
    out.reset(map.columns, map.rows);
    const std::vector<uint8_t> levels = hypothesis_levels(request_.view, hypothesis);
    for (size_t i = 0; i < levels.size(); i++) {
      const double off = array_.disparity() * std::abs(map.inverse_of(levels[i]) - truth(map, i));
      const double deviation = std::min(30., 2 + 2 * off);
      out.weight[i] = PhotoConsistency::kWeightOne;
      out.luma[i] = 100 * PhotoConsistency::kLumaOne;
      out.square[i] = static_cast<uint16_t>(std::lround(100 * 100 + deviation * deviation));
    }
    return out;
  }
  PhotoConsistency measured() const {
    const FocalMap& map = *request_.view.focus.map;
    PhotoConsistency out;
    out.reset(map.columns, map.rows);
    for (size_t i = 0; measures_ && i < out.weight.size(); i++) {
      if (static_cast<int>(i) % map.columns >= columns_) continue;
      out.weight[i] = PhotoConsistency::kWeightOne;
      out.luma[i] = PhotoConsistency::luma_of(out.weight[i], map.level_of(truth(map, i) * error_));
    }
    return out;
  }
  void run(int requests) {
    for (int i = 0; i < requests; i++) {
      std::vector<PhotoConsistency> sums;
      for (const DepthHypothesis& hypothesis : request_.hypotheses)
        sums.push_back(hypothesis.kind == kMeasured ? measured() : consistency(hypothesis));
      with_hypotheses_ += !request_.hypotheses.empty();
      requests_since_search_ += measures_depth(request_.hypotheses);
      request_.sequence++;
      const DepthEstimator::Plan plan = control_.next(request_, sums, array_);
      request_.view = plan.view;
      request_.hypotheses = plan.hypotheses;
    }
  }
  // Returns the mean difference between the surface and the scene, in pixels of disparity.
  double error() const {
    const FocalMap& map = *request_.view.focus.map;
    double sum = 0;
    for (size_t i = 0; i < map.levels.size(); i++)
      sum += array_.disparity() * std::abs(map.inverse_of(map.levels[i]) - truth(map, i));
    return sum / static_cast<double>(map.levels.size());
  }

  const Rig rig_ = wide_rig();
  const FocusArray array_{rig_};
  DepthEstimator control_{{.mode = FocusMode::kSurface}};
  ViewRequest request_;
  double right_ = kRight;
  bool measures_ = false;
  double error_ = 1;       // factor of the measured inverse distances
  int columns_ = INT_MAX;  // width of the map that the cameras measure
  int requests_since_search_ = 0, with_hypotheses_ = 0;
};

TEST_F(WideArrayTest, TheMeasuredSurfaceIsShown) {
  run(30);
  ASSERT_GT(array_.disparity() * (kRight - kLeft), kWideDisparity);
  EXPECT_GT(requests_since_search_, 2) << control_.state().near << " " << control_.state().far;
  EXPECT_LT(requests_since_search_, 10);
  EXPECT_FALSE(control_.state().on_plane) << "the surface of the search";
  measures_ = true;
  requests_since_search_ = 0;
  run(10);
  EXPECT_GT(requests_since_search_, 4);
  EXPECT_FALSE(control_.state().on_plane);
  EXPECT_LT(error(), 0.2);
}

TEST_F(WideArrayTest, ItIsShownInARangeOfTheViewer) {
  control_ = DepthEstimator({.mode = FocusMode::kSurface, .near = 1, .far = 40});
  measures_ = true;
  run(20);
  EXPECT_GT(requests_since_search_, 2);
  EXPECT_LT(error(), 0.2);
  EXPECT_FALSE(control_.state().on_plane);
  EXPECT_NEAR(control_.state().near, 1, 1e-6);
  EXPECT_NEAR(control_.state().far, 40, 1e-6);
}

TEST_F(WideArrayTest, CamerasAreNotAskedInANarrowRange) {
  const double far = 1.5 + 0.9 * kWideDisparity / (array_.disparity() * kRight * kRight);
  ASSERT_LT(array_.disparity() * (kRight - 1 / far), kWideDisparity);
  control_ = DepthEstimator({.mode = FocusMode::kSurface, .near = 1.5, .far = far});
  measures_ = true;
  run(40);
  EXPECT_EQ(requests_since_search_, 0);
}

TEST_F(WideArrayTest, ItIsShownSoonOnABusyMachine) {
  measures_ = true;
  control_.set_min_interval(8);
  run(20);
  EXPECT_LT(error(), 0.2);
  EXPECT_FALSE(control_.state().on_plane);
}

// While a viewer moves, no camera with a depth map may see the border of the view.
TEST_F(WideArrayTest, TheSurfaceContinuesWhereNoCameraMeasures) {
  measures_ = true;
  run(1);
  columns_ = request_.view.focus.map->columns * 3 / 4;
  run(30);
  EXPECT_LT(error(), 0.2);
  EXPECT_FALSE(control_.state().on_plane);
}

TEST_F(WideArrayTest, ItIsRequestedLessOftenAtRest) {
  measures_ = true;
  run(40);
  ASSERT_LT(error(), 0.2);
  requests_since_search_ = 0;
  run(40);
  EXPECT_EQ(requests_since_search_, 5);
  request_.view.pose.position.x += 0.1;
  run(2);
  EXPECT_EQ(requests_since_search_, 6) << "at once when the viewer moves";
}

TEST_F(WideArrayTest, ItFollowsTheScene) {
  measures_ = true;
  run(40);
  right_ = 0.9 * kRight;
  run(20);
  EXPECT_LT(error(), 0.2);
  EXPECT_FALSE(control_.state().on_plane);
}

TEST_F(WideArrayTest, AWrongSurfaceIsNotShown) {
  measures_ = true;
  error_ = 0.5;
  run(60);
  EXPECT_LT(error(), 2) << "the search has found the surface";
  EXPECT_FALSE(control_.state().on_plane);
  requests_since_search_ = 0;
  run(100);
  EXPECT_EQ(requests_since_search_, 0) << "the cameras are wrong";
}

TEST_F(WideArrayTest, WithoutMeasurementsTheSearchGoesOn) {
  measures_ = true;
  run(40);
  measures_ = false;
  run(150);
  EXPECT_LT(error(), 2);
  EXPECT_FALSE(control_.state().on_plane);
  measures_ = true;
  run(20);
  EXPECT_LT(error(), 0.2) << "the cameras measure again";
}

TEST_F(WideArrayTest, CamerasMayTakeLongToMeasure) {
  run(600);
  measures_ = true;
  run(40);
  EXPECT_LT(error(), 0.2);
  EXPECT_FALSE(control_.state().on_plane);
}

TEST(DepthEstimator, CamerasSideBySideMeasureNothing) {
  Loop loop(FocusMode::kAuto, false, 0, 0);
  for (int i = 0; i < 100; i++) {
    loop.run(1);
    EXPECT_FALSE(measures_depth(loop.request.hypotheses));
  }
}

TEST(DepthEstimator, FocusesPartOfAView) {
  Loop loop(FocusMode::kSurface, false, 0, 0);
  View& view = loop.viewers;
  view.width *= 3;
  view.height *= 3;
  view.lens = Lens::from_fov_y(70, view.width, view.height);
  view.pose.position = {0.013, -0.017, -0.15};
  view.blending.extrapolates = false;
  loop.request.view = view;
  loop.run(2);
  const std::vector<float> evidence = loop.array.evidence(loop.surface, {});
  const auto seen = std::ranges::count_if(evidence, [](float of_node) { return of_node > 0; });
  ASSERT_LT(static_cast<double>(seen), 0.2 * static_cast<double>(evidence.size()));
  loop.run(28);
  EXPECT_TRUE(loop.shows_surface());
}

TEST(DepthEstimator, FindsASurfaceOutsideTheArray) {
  for (const bool by_angle : {false, true}) {
    Loop loop(FocusMode::kSurface, false, 0, 0);
    const Vec3& corner = loop.walls.rig.cameras.back().pose.position;
    loop.look_from(corner + 0.5 * (corner - loop.walls.rig.cameras[4].pose.position));
    if (by_angle) loop.viewers.blending = loop.request.view.blending = {Blending::Kind::kAngle, 0, 4};
    loop.run(30);
    EXPECT_TRUE(loop.shows_surface());
    EXPECT_GT(loop.right(), 0.9);
  }
}

TEST(DepthEstimator, HidesTheSurfaceWhenThePlaneIsBetter) {
  Loop loop(FocusMode::kSurface, false, 0, 0);
  loop.run(20);
  EXPECT_TRUE(loop.shows_surface());
  loop.walls = ArrayOfWalls(true);
  loop.run(8);
  EXPECT_FALSE(loop.shows_surface());
  for (int i = 0; i < 60; i++) {
    loop.run(1);
    EXPECT_FALSE(loop.shows_surface()) << i << ": no surface is better";
  }
  loop.walls = ArrayOfWalls(false);
  loop.run(30);
  EXPECT_TRUE(loop.shows_surface());
  EXPECT_GT(loop.right(), 0.97);
}

TEST(DepthEstimator, FindsASceneOutsideTheRange) {
  for (const FocusMode mode : {FocusMode::kSurface, FocusMode::kAuto}) {
    for (const double nearer : {3., 0.4}) {
      SCOPED_TRACE(nearer);
      Loop loop(mode, false, 0, 0);
      loop.run(30);
      loop.walls = ArrayOfWalls(false, nearer);
      loop.run(60);
      EXPECT_GT(loop.right(), 0.95);
      EXPECT_GE(loop.control.state().scene_changes, 1u);
    }
  }
}

// Results of a request reach the request sent `underway` requests later, as with a long latency.
struct DelayedLoop : Loop {
  DelayedLoop(FocusMode mode, size_t underway) : Loop(mode, false, 0, 0), requests(underway, request) {}
  void run_delayed(size_t count) {
    for (size_t i = 0; i < count; i++) {
      request = requests.front();
      requests.pop_front();
      run(1);
      requests.push_back(request);
      surfaces.push_back(surface);
      if (surfaces.size() > requests.size()) surfaces.pop_front();
    }
  }
  // Over all surfaces in flight.
  double least_right() {
    double least = 1;
    for (const View& underway : surfaces) {
      surface = underway;
      least = std::min(least, right());
    }
    return least;
  }
  std::deque<ViewRequest> requests;
  std::deque<View> surfaces;
};

TEST(DepthEstimator, RequestsInFlightMakeOneSurface) {
  for (const FocusMode mode : {FocusMode::kSurface, FocusMode::kAuto})
    for (const size_t underway : {1, 2, 3, 4, 8, 16}) {
      SCOPED_TRACE(underway);
      DelayedLoop loop(mode, underway);
      loop.run_delayed(14 + 3 * underway);
      for (int i = 0; i < 20; i++) {
        EXPECT_GT(loop.least_right(), 0.97) << i;
        loop.run_delayed(1);
      }
      EXPECT_EQ(loop.control.state().scene_changes, 0u);
    }
}

TEST(DepthEstimator, FindsASceneOutsideTheRangeWithRequestsInFlight) {
  for (const FocusMode mode : {FocusMode::kSurface, FocusMode::kAuto})
    for (const size_t underway : {2, 3, 4, 8})
      for (const double nearer : {3., 0.4}) {
        SCOPED_TRACE(std::to_string(underway) + " underway, " + std::to_string(nearer) + " times nearer");
        DelayedLoop loop(mode, underway);
        loop.run_delayed(30 + 3 * underway);
        loop.walls = ArrayOfWalls(false, nearer);
        loop.run_delayed(60 + 6 * underway);
        EXPECT_GT(loop.least_right(), 0.95);
        const DepthEstimator::State& state = loop.control.state();
        EXPECT_GE(state.scene_changes, 1u);
        EXPECT_LE(state.scene_changes, DepthEstimator::kMaxFailedSearches) << "not one per request in flight";
        EXPECT_LT(state.near, 1.5 / nearer);
        EXPECT_GT(state.far, 3 / nearer);
      }
}

TEST(DepthEstimator, KeepsAGivenRange) {
  Loop loop(FocusMode::kSurface, false);
  loop.run(20);
  loop.walls = ArrayOfWalls(false, 3);
  loop.run(20);
  EXPECT_NEAR(loop.control.state().near, 1.2, 1e-12);
  EXPECT_NEAR(loop.control.state().far, 6, 1e-12);
}

TEST(DepthEstimator, LatePicturesReduceHypotheses) {
  Loop punctual(FocusMode::kSurface, false), late(FocusMode::kSurface, false);
  for (int i = 0; i < 60; i++) {
    punctual.control.adapt_interval(true);
    punctual.run(1);
    late.control.adapt_interval(false);
    late.run(1);
  }
  EXPECT_LE(late.hypotheses, punctual.hypotheses / 2);
  EXPECT_GT(late.right(), 0.95) << "the surface converges nevertheless";
  late.hypotheses = 0;
  for (int i = 0; i < 180; i++) {
    late.control.adapt_interval(true);
    late.run(1);
  }
  EXPECT_GT(late.hypotheses, 4 * 60u) << "rate restored";
}

// A busy machine answers so few requests that a search with every eighth would take a minute.
TEST(DepthEstimator, TheFirstSurfaceIsNotSpared) {
  Loop loop(FocusMode::kAuto, false, 0, 0);
  loop.control.set_min_interval(8);
  loop.run(14);
  EXPECT_GT(loop.right(), 0.9);
  EXPECT_TRUE(loop.shows_surface());
  const size_t before = loop.hypotheses;
  loop.run(8);
  EXPECT_LT(loop.hypotheses - before, 8u) << "one round of refinement";
}

TEST(DepthEstimator, SpareReducesHypotheses) {
  Loop all(FocusMode::kSurface, false), spared(FocusMode::kSurface, false);
  for (int i = 0; i < 120; i++) {
    all.run(1);
    spared.control.set_min_interval(4);
    spared.run(1);
  }
  EXPECT_LE(spared.hypotheses, all.hypotheses / 3);
  EXPECT_GT(spared.hypotheses, 0u);
  EXPECT_GT(spared.right(), 0.9) << "the surface converges nevertheless";
}

}  // namespace
}  // namespace lf
