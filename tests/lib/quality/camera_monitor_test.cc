// SPDX-License-Identifier: LGPL-2.1-or-later
#include "quality/camera_monitor.h"
#include "composite/still.h"
#include "quality/image_quality.h"
#include "scene/scene.h"
#include "support/test.h"

namespace lf {
namespace {

using Fault = CameraMonitor::Fault;

// An array with some bad cameras: predictions from a bad camera are half as far off.
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

TEST_F(MonitoredArray, GoodCamerasAreNotSuspected) {
  turns(200);
  EXPECT_THAT(monitor_.suspects(), IsEmpty());
  EXPECT_EQ(monitor_.turns(), 200u);
  EXPECT_NEAR(monitor_.error(7).psnr_db, 25.1, 1e-9);
}

TEST_F(MonitoredArray, FindsBadCamerasWithoutTheirNeighbours) {
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

TEST_F(MonitoredArray, SettlesAfterASecondCheckOfOutliers) {
  turns(24);
  EXPECT_FALSE(monitor_.is_settled());
  turns(1);
  EXPECT_TRUE(monitor_.is_settled());
  monitor_ = CameraMonitor(scene_rig(kSide, kSide, 32, 24));
  bad_ = {7, 18};
  off = [](CameraIndex camera) {
    return camera == 7 || camera == 18 ? PredictionError{18, 1, {0.9, 0}}
                                       : PredictionError{25 + 0.1 * (camera % 3), 1, {0, 0}};
  };
  while (!monitor_.is_settled() && monitor_.turns() < 200) turns(1);
  EXPECT_GT(monitor_.turns(), 25u);
  EXPECT_LT(monitor_.turns(), 75u);
  EXPECT_THAT(monitor_.suspected(), ElementsAre(7, 18));
}

TEST_F(MonitoredArray, NoticesLaterFaultsAndRepairs) {
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

TEST_F(MonitoredArray, CamerasOutOfServiceAreNotChecked) {
  out_ = {0, 3};
  turns(46);
  EXPECT_TRUE(std::isnan(monitor_.error(0).psnr_db));
  EXPECT_FALSE(std::isnan(monitor_.error(1).psnr_db));
  out_.resize(kSide * kSide);
  std::iota(out_.begin(), out_.end(), 0);
  EXPECT_EQ(monitor_.next(out_), std::nullopt);
}

TEST_F(MonitoredArray, UnknownValuesSuspectNoCamera) {
  off = [](CameraIndex camera) { return camera < 4 ? PredictionError{camera ? 30.0 : 5.0, 1, {0, 0}} : kNoPrediction; };
  turns(100);
  EXPECT_THAT(monitor_.suspects(), IsEmpty());
}

TEST(CameraProbe, SeesEveryFourthPixelOfTheCamera) {
  Rig rig = scene_rig(3, 3, 320, 240);
  rig.cameras[4].lens = Lens(LensModel::kOpenCv, {300, 310, 150, 130, -0.1, 0.02, 0.001, -0.002});
  rig.cameras[4].pose.orientation = glm::normalize(Quat(1, 0.01, 0.02, 0));
  const Camera& camera = rig.cameras[4];
  const Image image = render_scene({320, 240, camera.lens, camera.pose}, 0);
  const View focused{64, 48, Lens::pinhole(50, 31.5, 23.5), {}, {focal_plane_at({}, kSceneMiddle)}};
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

TEST(CameraProbe, IsNotLargerThanItsCamera) {
  Rig rig = scene_rig(2, 2, 50, 37);
  rig.cameras[1].width = 1921;
  rig.cameras[1].height = 1081;
  const View focused{8, 8, Lens::pinhole(8, 3.5, 3.5), {}, {focal_plane_at({}, 1)}};
  const View small = make_probe(rig, 0, focused, {0}).predicted.view, large = make_probe(rig, 1, focused, {}).seen.view;
  EXPECT_EQ(small.width, 50);
  EXPECT_EQ(small.height, 37);
  EXPECT_EQ(small.lens, rig.cameras[0].lens);
  EXPECT_LE(large.width, kProbeColumns);
  EXPECT_EQ(make_probe(rig, 0, focused, {0}).predicted.out_of_service, CameraSet{0});
}

using TurnResult = ProbeScheduler::TurnResult;

class ProbeSchedulerTest : public testing::Test {
 protected:
  ProbeSchedulerTest() {
    shown_.view = {64, 48, Lens::pinhole(50, 31.5, 23.5), {}, {focal_plane_at({}, kSceneMiddle)}};
  }
  CoverageImage picture(const ViewRequest& probe, double gain = 1) const {
    const View& view = probe.view;
    CoverageImage picture{render_scene({view.width, view.height, view.lens, view.pose}, 0), {}};
    for (uint8_t& value : picture.rgb.data()) value = static_cast<uint8_t>(std::min(255., std::round(gain * value)));
    picture.coverage.assign(static_cast<size_t>(view.width) * view.height, 1);
    return picture;
  }
  // One turn of the next camera, with its own picture `gain` times as bright.
  TurnResult turn(const CameraProbe& probe, double gain = 1) {
    EXPECT_TRUE(turns_.expects(probe.seen));
    EXPECT_EQ(turns_.take(probe.seen, picture(probe.seen, gain)), TurnResult::kFirstProbe);
    EXPECT_TRUE(turns_.expects(probe.predicted));
    return turns_.take(probe.predicted, picture(probe.predicted));
  }

  const Rig rig_ = scene_rig(3, 3, 80, 60);
  ViewRequest shown_;
  ProbeScheduler turns_;
};

TEST_F(ProbeSchedulerTest, WaitsForLostProbes) {
  ASSERT_TRUE(turns_.next(rig_, shown_, 1));
  for (unsigned i = 0; i < ProbeScheduler::kProbeTimeout; i++) EXPECT_FALSE(turns_.next(rig_, shown_, 1)) << i;
  EXPECT_TRUE(turns_.next(rig_, shown_, 1));
  turns_.lose();
  EXPECT_TRUE(turns_.next(rig_, shown_, 1));
}

TEST_F(ProbeSchedulerTest, IgnoresOtherProbes) {
  ViewRequest other;
  EXPECT_FALSE(turns_.expects(other)) << "no probe pending";
  const auto probe = turns_.next(rig_, shown_, 1).value();
  other = probe.seen;
  other.view.pose.position.x += 1;
  EXPECT_FALSE(turns_.expects(other)) << "not a probe";
  EXPECT_TRUE(turns_.expects(probe.seen)) << "the probe is unaffected";
  EXPECT_FALSE(turns_.expects(probe.predicted)) << "nothing to compare with";
  EXPECT_FALSE(turns_.expects(probe.seen)) << "the probe is over";
  EXPECT_EQ(turns_.monitor()->turns(), 0u);
}

TEST_F(ProbeSchedulerTest, NewRigRestartsTheChecks) {
  turn(*turns_.next(rig_, shown_, 1));
  EXPECT_EQ(turns_.monitor()->turns(), 1u);
  EXPECT_TRUE(turns_.next(scene_rig(2, 2, 80, 60), shown_, 1));
  EXPECT_EQ(turns_.monitor()->cameras(), 4u);
  EXPECT_EQ(turns_.monitor()->turns(), 0u);
}

// Predictions have no error, because the test knows the exact scene.
TEST_F(ProbeSchedulerTest, DarkCameraBecomesSuspect) {
  constexpr CameraIndex kDark = 4;
  TurnResult latest = TurnResult::kBothProbes;
  for (size_t i = 0; i < 4 * rig_.cameras.size() && latest != TurnResult::kSuspectsChanged; i++) {
    const auto probe = turns_.next(rig_, shown_, 1).value();
    latest = turn(probe, probe.camera == kDark ? 0.8 : 1);
  }
  EXPECT_EQ(latest, TurnResult::kSuspectsChanged);
  EXPECT_EQ(turns_.monitor()->suspects(),
            std::vector<CameraMonitor::Suspect>({{kDark, CameraMonitor::Fault::kColour}}));
}

std::vector<double> even(double first, double period, int count) {
  std::vector<double> times;
  for (int i = 0; i < count; i++) times.push_back(first + period * i);
  return times;
}

TEST(FrameTimeStats, RegularFramesHaveARate) {
  const FrameTimeStats times = frame_time_stats(even(1e5, 1 / 30.0, 90));
  EXPECT_EQ(times.frames, 90u);
  EXPECT_NEAR(times.rate(), 30, 1e-6);
  EXPECT_NEAR(times.first, 1e5, 1e-8);
  EXPECT_LT(times.jitter, 1e-8);
  EXPECT_EQ(times.missing, 0u);
  EXPECT_EQ(times.backwards, 0u);
}

TEST(FrameTimeStats, MissingFramesAreCountedAndDoNotChangeTheRate) {
  std::vector<double> times = even(3, 0.04, 100);
  times.erase(times.begin() + 60, times.begin() + 63);
  times.erase(times.begin() + 10);
  const FrameTimeStats measured = frame_time_stats(times);
  EXPECT_EQ(measured.missing, 4u);
  EXPECT_NEAR(measured.period, 0.04, 1e-9);
}

TEST(FrameTimeStats, MeasuresJitter) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 0.002);
  std::vector<double> times = even(0, 1 / 15.0, 300);
  for (double& time : times) time += noise(random);
  const FrameTimeStats measured = frame_time_stats(times);
  EXPECT_NEAR(measured.jitter, 0.002, 0.0003);
  EXPECT_NEAR(measured.rate(), 15, 0.01);
  EXPECT_EQ(measured.missing, 0u);
}

TEST(FrameTimeStats, DecreasingTimesAreCountedAndLeftOut) {
  std::vector<double> times = even(0, 0.1, 20);
  times[10] = times[8];
  const FrameTimeStats measured = frame_time_stats(times);
  EXPECT_EQ(measured.backwards, 1u);
  EXPECT_NEAR(measured.period, 0.1, 1e-9);
  EXPECT_EQ(measured.missing, 1u) << "frame without a known capture time";
}

TEST(FrameTimeStats, FewFramesHaveNoRate) {
  for (int count = 0; count < 3; count++) EXPECT_EQ(frame_time_stats(even(0, 0.1, count)).period, 0) << count;
}

TEST(Skew, HandlesWrappedPhases) {
  const double period = 0.04;
  for (const double shift : {0.0, 0.013, 0.0199, 0.039}) {
    const std::vector<FrameTimeStats> cameras = {frame_time_stats(even(shift, period, 50)),
                                                 frame_time_stats(even(shift + 0.004 + period, period, 50)),
                                                 frame_time_stats(even(shift - 0.004, period, 50))};
    const Skew skew = camera_skew(cameras);
    EXPECT_NEAR(skew.phase[0], 0, 1e-9) << shift;
    EXPECT_NEAR(skew.phase[1], 0.004, 1e-9) << shift;
    EXPECT_NEAR(skew.phase[2], -0.004, 1e-9) << shift;
    EXPECT_NEAR(skew.spread, 0.008, 1e-9);
    EXPECT_NEAR(skew.drift, 0, 1e-9);
  }
}

TEST(Skew, LeavesOutOtherRatesAndMeasuresDrift) {
  const std::vector<FrameTimeStats> cameras = {
      frame_time_stats(even(0, 0.04, 50)), frame_time_stats(even(0, 0.040004, 50)), FrameTimeStats{},
      frame_time_stats(even(0, 0.1, 50)), frame_time_stats(even(0.01, 0.04, 50))};
  const Skew skew = camera_skew(cameras);
  EXPECT_TRUE(std::isnan(skew.phase[2]));
  EXPECT_TRUE(std::isnan(skew.phase[3]));
  EXPECT_NEAR(skew.drift, 1e-4, 1e-9);
  EXPECT_NEAR(skew.phase[4] - skew.phase[0], 0.01, 1e-4);
  EXPECT_TRUE(camera_skew({}).phase.empty());
}

class HandWaveDetectorTest : public testing::Test {
 protected:
  template <typename Change>
  void pass(double seconds, Change change) {
    for (const double end = time_ + seconds; time_ < end; time_ += 0.2)
      for (size_t camera = 0; camera < 4; camera++) {
        std::vector<float> parts(48);
        for (size_t i = 0; i < parts.size(); i++) parts[i] = (i % 2 ? 0.7f : 0.3f) + noise_(random_);
        change(camera, parts);
        finder_.see(camera, parts, time_);
      }
  }
  static void nothing(size_t, std::vector<float>&) {}
  std::mt19937 random_{1};
  std::normal_distribution<float> noise_{0, 0.01f};
  double time_ = 100;
  HandWaveDetector finder_{4};
};

TEST_F(HandWaveDetectorTest, FindsTheCoveredCamera) {
  pass(2, nothing);
  EXPECT_EQ(finder_.found(), std::nullopt);
  for (const size_t which : {2, 0}) {
    pass(1, [=](size_t camera, std::vector<float>& parts) {
      if (camera == which) std::fill(parts.begin(), parts.end(), 0.15f);
    });
    EXPECT_EQ(finder_.found(), which);
    EXPECT_GT(finder_.change(which), 0.15);
    pass(1, nothing);
    EXPECT_EQ(finder_.found(), std::nullopt);
  }
}

TEST_F(HandWaveDetectorTest, IgnoresCommonChangesAndLight) {
  pass(2, nothing);
  pass(1, [](size_t, std::vector<float>& parts) { std::fill(parts.begin(), parts.begin() + 24, 0.1f); });
  EXPECT_EQ(finder_.found(), std::nullopt) << "a person walks past";
  pass(30, nothing);
  pass(1, [](size_t camera, std::vector<float>& parts) {
    for (float& part : parts) part += camera == 1 ? 0.1f : 0.f;
  });
  EXPECT_EQ(finder_.found(), std::nullopt) << "exposure change of a camera";
}

TEST_F(HandWaveDetectorTest, LastingChangesBecomeUsual) {
  const auto covered = [](size_t camera, std::vector<float>& parts) {
    if (camera == 3) std::fill(parts.begin(), parts.end(), 0.1f);
  };
  pass(2, nothing);
  pass(1, covered);
  EXPECT_EQ(finder_.found(), 3u);
  pass(60, covered);
  EXPECT_EQ(finder_.found(), std::nullopt);
}

TEST(HandWaveDetector, FindsNothingWithoutCameras) {
  EXPECT_EQ(HandWaveDetector(0).found(), std::nullopt);
  EXPECT_EQ(HandWaveDetector(1).found(), std::nullopt);
}

}  // namespace
}  // namespace lf
