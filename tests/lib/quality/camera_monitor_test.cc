// SPDX-License-Identifier: LGPL-2.1-or-later
#include "quality/camera_monitor.h"

#include <cmath>
#include <functional>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "composite/still.h"
#include "quality/quality.h"
#include "scene/scene.h"

namespace lf {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using Fault = CameraMonitor::Fault;

// An array some of whose cameras are bad: those that are predicted from a bad one are half as far off.
class MonitoredArray : public testing::Test {
 protected:
  static constexpr int kSide = 5;
  PredictionError measured(CameraIndex camera) const {
    PredictionError error = off(camera);
    const CameraSet without = monitor_.suspected();
    const int row = static_cast<int>(camera) / kSide, column = static_cast<int>(camera) % kSide;
    for (const CameraIndex other : bad_) {
      if (std::ranges::binary_search(without, other) || other == camera) continue;
      const int down = std::abs(static_cast<int>(other) / kSide - row);
      const int across = std::abs(static_cast<int>(other) % kSide - column);
      if (down + across != 1) continue;
      const PredictionError spoilt = off(other);
      error.psnr_db = std::min(error.psnr_db, (spoilt.psnr_db + 25) / 2);
      error.gain -= (spoilt.gain - 1) / 2;
      error.shift -= spoilt.shift / 2.0;
    }
    return error;
  }
  void turns(int count) {
    for (int i = 0; i < count; i++)
      if (const auto camera = monitor_.next(out_)) monitor_.take(*camera, measured(*camera));
  }

  std::set<CameraIndex> bad_;
  std::function<PredictionError(CameraIndex)> off = [](CameraIndex camera) {
    return PredictionError{25 + 0.1 * (camera % 3), 1 + 0.001 * (camera % 5), {0.02 * (camera % 2), 0}};
  };
  CameraSet out_;
  CameraMonitor monitor_{scene_rig(kSide, kSide, 32, 24)};
};

TEST_F(MonitoredArray, OfGoodCamerasNobodyIsSuspected) {
  turns(200);
  EXPECT_THAT(monitor_.suspects(), IsEmpty());
  EXPECT_EQ(monitor_.turns(), 200u);
  EXPECT_NEAR(monitor_.error(7).psnr_db, 25.1, 1e-9);
}

TEST_F(MonitoredArray, BadOnesAreFoundAndNoneOfTheirNeighbours) {
  bad_ = {7, 8, 18};
  off = [](CameraIndex camera) {
    if (camera == 7) return PredictionError{24, 1, {-0.9, 0.1}};
    if (camera == 8) return PredictionError{23, 1.1, {0, 0}};
    if (camera == 18) return PredictionError{18, 1.01, {0.1, 0.05}};
    return PredictionError{25 + 0.1 * (camera % 3), 1, {0, 0}};
  };
  std::set<CameraIndex> ever;
  for (int i = 0; i < 120; i++) {
    turns(1);
    for (const CameraIndex camera : monitor_.suspected()) ever.insert(camera);
  }
  EXPECT_THAT(monitor_.suspects(),
              ElementsAre(CameraMonitor::Suspect{7, Fault::kDirection}, CameraMonitor::Suspect{8, Fault::kColour},
                          CameraMonitor::Suspect{18, Fault::kPicture}));
  EXPECT_EQ(ever, bad_);
}

TEST_F(MonitoredArray, SettlesOnItsSuspectsAfterATurnOfEachAndAnotherOfTheOdd) {
  turns(24);
  EXPECT_FALSE(monitor_.settled());
  turns(1);
  EXPECT_TRUE(monitor_.settled());
  monitor_ = CameraMonitor(scene_rig(kSide, kSide, 32, 24));
  bad_ = {7, 18};
  off = [](CameraIndex camera) {
    return camera == 7 || camera == 18 ? PredictionError{18, 1, {0.9, 0}}
                                       : PredictionError{25 + 0.1 * (camera % 3), 1, {0, 0}};
  };
  while (!monitor_.settled() && monitor_.turns() < 200) turns(1);
  EXPECT_GT(monitor_.turns(), 25u);
  EXPECT_LT(monitor_.turns(), 75u);
  EXPECT_THAT(monitor_.suspected(), ElementsAre(7, 18));
}

TEST_F(MonitoredArray, WhatHappensLaterIsNoticedSoonAndForgivenOnceMended) {
  turns(60);
  bad_ = {12};
  const auto good = off;
  off = [&](CameraIndex camera) { return camera == 12 ? PredictionError{22, 0.9, {0, 0}} : good(camera); };
  turns(25 + 25);
  EXPECT_THAT(monitor_.suspects(), ElementsAre(CameraMonitor::Suspect{12, Fault::kColour}));
  bad_.clear();
  off = good;
  turns(25);
  EXPECT_THAT(monitor_.suspects(), IsEmpty());
}

TEST_F(MonitoredArray, CamerasOutOfServiceHaveNoTurn) {
  out_ = {0, 3};
  turns(46);
  EXPECT_TRUE(std::isnan(monitor_.error(0).psnr_db));
  EXPECT_FALSE(std::isnan(monitor_.error(1).psnr_db));
  out_.clear();
  for (CameraIndex i = 0; i < kSide * kSide; i++) out_.push_back(i);
  EXPECT_EQ(monitor_.next(out_), std::nullopt);
}

TEST_F(MonitoredArray, WithoutFiguresNobodyIsJudged) {
  off = [](CameraIndex camera) { return camera < 4 ? PredictionError{camera ? 30.0 : 5.0, 1, {0, 0}} : kNotPredicted; };
  turns(100);
  EXPECT_THAT(monitor_.suspects(), IsEmpty());
}

TEST(CameraProbe, SeesEveryFourthPixelOfTheCamera) {
  Rig rig = scene_rig(3, 3, 320, 240);
  rig.cameras[4].lens = Lens(LensModel::kOpenCv, {300, 310, 150, 130, -0.1, 0.02, 0.001, -0.002});
  rig.cameras[4].pose.orientation = glm::normalize(Quat(1, 0.01, 0.02, 0));
  const Camera& camera = rig.cameras[4];
  const Image image = render_scene({320, 240, camera.lens, camera.pose}, 0);
  View focused{.width = 64, .height = 48, .lens = Lens::pinhole(50, 31.5, 23.5), .pose = {}, .focus = {}};
  focused.focus.plane = focal_plane_at(focused.pose, kSceneMiddle);
  const CameraProbe probe = make_probe(rig, 4, focused, {1, 7});
  EXPECT_TRUE(probe.seen.probe && probe.predicted.probe);
  EXPECT_EQ(probe.seen.view.width, 80);
  EXPECT_EQ(probe.seen.out_of_service, (CameraSet{0, 1, 2, 3, 5, 6, 7, 8}));
  EXPECT_EQ(probe.predicted.out_of_service, (CameraSet{1, 4, 7}));
  EXPECT_EQ(probe.predicted.view.focus, focused.focus);
  validate(probe.seen.view);

  const auto images = [&](CameraIndex) -> const Image& { return image; };
  const Still still = render_still(rig, build_mesh(rig, probe.seen.out_of_service), probe.seen.view, images);
  Image sampled(PixelFamily::kRgb, probe.seen.view.width, probe.seen.view.height);
  for (int y = 0; y < sampled.height(); y++)
    for (int x = 0; x < sampled.width(); x++) std::copy_n(image.pixel(4 * x + 1, 4 * y + 1), 3, sampled.pixel(x, y));
  EXPECT_LE(compare(still.picture, sampled).max_error, 1);
}

TEST(CameraProbe, IsNeverLargerThanItsCamera) {
  Rig rig = scene_rig(2, 2, 50, 37);
  rig.cameras[1].width = 1921;
  rig.cameras[1].height = 1081;
  View focused{.width = 8, .height = 8, .lens = Lens::pinhole(8, 3.5, 3.5), .pose = {}, .focus = {}};
  focused.focus.plane = focal_plane_at(focused.pose, 1);
  const View small = make_probe(rig, 0, focused, {0}).predicted.view, large = make_probe(rig, 1, focused, {}).seen.view;
  EXPECT_EQ(small.width, 50);
  EXPECT_EQ(small.height, 37);
  EXPECT_EQ(small.lens, rig.cameras[0].lens);
  EXPECT_LE(large.width, kProbeColumns);
  EXPECT_EQ(make_probe(rig, 0, focused, {0}).predicted.out_of_service, CameraSet{0});
}

}  // namespace

}  // namespace lf
