// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/camera_inputs.h"
#include "support/test.h"

namespace lf {
namespace {

// Streaming threads meet only here: also run under ThreadSanitizer (tests/sanitize.sh thread).

using Mode = CameraFrames::Mode;
using PushResult = CameraFrames::PushResult;

CameraFrame frame(uint64_t time) {
  CameraFrame frame;
  frame.time = time;
  return frame;
}

constexpr bool kFile = false, kLive = true;

// Runs, and its stream has started.
struct StartedFrames : CameraFrames {
  explicit StartedFrames(bool live) {
    set_mode(Mode::kRunning);
    start_stream(live);
  }
};

TEST(CameraFrames, RejectsFramesWhileStopped) {
  CameraFrames frames;
  EXPECT_EQ(frames.push(frame(0)), PushResult::kStopped);
  EXPECT_FALSE(frames.find(0, true));
}

TEST(CameraFrames, RequestsFindTheirFramesOfAFile) {
  StartedFrames frames(kFile);
  constexpr uint64_t kCount = 5000;
  std::thread camera([&] {
    for (uint64_t t = 0; t < kCount; t++) ASSERT_EQ(frames.push(frame(t * 10)), PushResult::kTaken);
    frames.end_stream();
  });
  for (uint64_t t = 0; t < kCount; t++) {
    const std::optional<CameraFrame> found = frames.find(t * 10, true);
    ASSERT_TRUE(found);
    ASSERT_EQ(found->time, t * 10);
    ASSERT_LE(frames.held(), CameraFrames::kFileFrames);
  }
  camera.join();
}

TEST(CameraFrames, UnusedCameraKeepsUp) {
  StartedFrames frames(kFile);
  std::atomic<uint64_t> pushed{0};
  std::thread camera([&] {
    for (uint64_t t = 0; t < 100; t++, pushed++) ASSERT_EQ(frames.push(frame(t)), PushResult::kTaken);
  });
  for (uint64_t t = 0; t < 100; t++) frames.advance(t);
  camera.join();
  EXPECT_EQ(pushed, 100u);
  EXPECT_EQ(frames.find(99, true)->time, 99u);
}

TEST(CameraFrames, NewestFrameOfAFileIsTheCurrentFrame) {
  StartedFrames frames(kFile);
  frames.push(frame(5));
  for (int i = 0; i < 10; i++) EXPECT_EQ(frames.find(kNoTime, true)->time, 5u);
}

TEST(CameraFrames, NoFrameAfterALoss) {
  for (const bool live : {false, true}) {
    StartedFrames frames(live);
    for (const uint64_t time : {0, 10}) EXPECT_EQ(frames.push(frame(time)), PushResult::kTaken);
    frames.lose_stream();
    EXPECT_EQ(frames.find(19, true)->time, 10u) << "own capture time";
    EXPECT_FALSE(frames.find(20, true)) << "without waiting";
    EXPECT_FALSE(frames.find(kNoTime, true));
    frames.end_stream();
    EXPECT_FALSE(frames.find(30, true)) << "not held forever without EOS";
    frames.start_stream(live);
    EXPECT_EQ(frames.push(frame(40)), PushResult::kTaken);
    EXPECT_EQ(frames.find(40, true)->time, 40u);
  }
}

TEST(CameraFrames, LostCameraWithoutFramesIsNotAwaited) {
  CameraFrames frames;
  frames.set_mode(Mode::kRunning);
  std::thread loses([&] { frames.lose_stream(); });
  EXPECT_FALSE(frames.find(0, true));
  loses.join();
}

TEST(CameraFrames, LiveClientsDoNotWaitForCameras) {
  CameraFrames frames;
  frames.set_mode(Mode::kRunning);
  EXPECT_FALSE(frames.find(100, false));
}

// A viewer that waits for slow cameras needs the frames of fast cameras for as long.
TEST(CameraFrames, LiveFramesAreKeptForOldRequests) {
  StartedFrames frames(kLive);
  constexpr uint64_t kPeriod = 33'000'000, kBack = 515'000'000;
  for (uint64_t k = 0; k < 300; k++) {
    ASSERT_EQ(frames.push(frame(k * kPeriod)), PushResult::kTaken);
    if (k * kPeriod < kBack) continue;
    const uint64_t wanted = k * kPeriod - kBack;
    const std::optional<CameraFrame> found = frames.find(wanted, false);
    ASSERT_TRUE(found);
    if (k > 40) {
      ASSERT_LE(time_between(found->time, wanted), kPeriod / 2) << k;
    }
    ASSERT_LE(frames.held(), kBack / kPeriod + 3);
    ASSERT_EQ(frames.period(), kPeriod);
    if (k != 299) continue;
    const uint64_t before = wanted - kPeriod;  // for an answer that is late by a frame
    EXPECT_LE(time_between(frames.find(before, false)->time, before), kPeriod / 2);
  }
  for (uint64_t k = 300; k < 1000; k++) {
    frames.push(frame(k * kPeriod));
    frames.find(k * kPeriod, false);
  }
  EXPECT_EQ(frames.held(), CameraFrames::kLiveFrames);
  frames.find(0, false);
  frames.push(frame(1000 * kPeriod));
  EXPECT_EQ(frames.held(), CameraFrames::kLiveFrames);
}

// The longest capture delay of lf-serve.
TEST(CameraFrames, LiveFramesAreKeptForTenSeconds) {
  StartedFrames frames(kLive);
  constexpr uint64_t kPeriod = 1'000'000'000 / 60, kBack = 10'000'000'000;
  for (uint64_t k = 0; k < 2000; k++) {
    frames.push(frame(k * kPeriod));
    if (k * kPeriod < kBack) continue;
    const uint64_t wanted = k * kPeriod - kBack;
    const std::optional<CameraFrame> found = frames.find(wanted, false);
    ASSERT_TRUE(found);
    if (k > 1300) {
      ASSERT_LE(time_between(found->time, wanted), kPeriod) << k;
    }
    ASSERT_LE(frames.held(), CameraFrames::kMaxLiveFrames);
  }
}

// All viewers would wait for a camera with an estimated period of seconds.
TEST(CameraFrames, PeriodIgnoresOutages) {
  StartedFrames frames(kLive);
  constexpr uint64_t kPeriod = 66'000'000, kAway = 6'500'000'000;
  for (uint64_t k = 0; k < 10; k++) frames.push(frame(k * kPeriod));
  frames.lose_stream();
  for (uint64_t k = 10; k < 20; k++) {
    frames.push(frame(kAway + k * kPeriod));
    EXPECT_EQ(frames.period(), kPeriod) << k;
    EXPECT_GE(frames.mean_period(), frames.period()) << k;
  }
}

TEST(CameraFrames, StoppingWakesBothSides) {
  for (int i = 0; i < 50; i++) {
    StartedFrames frames(kFile);
    std::thread camera([&] {
      uint64_t t = 0;
      while (frames.push(frame(t)) == PushResult::kTaken) t++;
    });
    std::thread requester([&] { frames.find(1'000'000'000'000, true); });
    std::thread stopper([&] { frames.set_mode(Mode::kStopped); });
    camera.join();
    requester.join();
    stopper.join();
  }
}

TEST(CameraFrames, FinishingEndsTheStream) {
  StartedFrames frames(kFile);
  std::atomic<PushResult> last{PushResult::kTaken};
  std::thread camera([&] {
    for (uint64_t t = 0; last == PushResult::kTaken; t++) last = frames.push(frame(t));
  });
  frames.set_mode(Mode::kFinished);
  camera.join();
  EXPECT_EQ(last, PushResult::kEnded);
}

TEST(CameraFrames, LiveCamerasDoNotFinish) {
  StartedFrames frames(kLive);
  frames.set_mode(Mode::kFinished);
  for (uint64_t t = 0; t < 10; t++) EXPECT_EQ(frames.push(frame(t)), PushResult::kTaken);
  const auto found = frames.find(9, true);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->time, 9u);
}

// Frames are distinguished without being decoded.
struct Compressed : CameraPicture {
  int width() const override { return 8; }
  int height() const override { return 8; }
  bool is_compressed() const override { return true; }
  bool takes_work(PixelFamily) const override { return true; }
  std::shared_ptr<const ImageView> view(PixelFamily, const Rect&) override { return nullptr; }
};
CameraFrame compressed(uint64_t time, const std::shared_ptr<CameraPicture>& picture) {
  CameraFrame f = frame(time);
  f.picture = picture;
  return f;
}

TEST(CameraFrames, PreviousFrameReplacesADamagedOne) {
  for (const bool live : {false, true}) {
    StartedFrames frames(live);
    const auto one = std::make_shared<Compressed>(), two = std::make_shared<Compressed>(),
               three = std::make_shared<Compressed>();
    frames.push(compressed(0, one));
    frames.push(compressed(10, two));
    EXPECT_EQ(frames.find(10, true)->picture, two);
    ASSERT_EQ(frames.push_damaged(20), PushResult::kTaken);
    const std::optional<CameraFrame> found = frames.find(20, true);
    EXPECT_EQ(found->picture, two);
    EXPECT_EQ(found->time, 10u) << "reports its own time";
    ASSERT_EQ(frames.push(compressed(30, three)), PushResult::kTaken);
    EXPECT_EQ(frames.find(30, true)->picture, three);
    bool first = false;
    const auto replaced = frames.replace_damaged(three.get(), &first);
    ASSERT_TRUE(replaced);
    EXPECT_EQ(replaced->picture, two);
    EXPECT_TRUE(first);
    EXPECT_EQ(frames.find(30, true)->picture, two) << "for all later requests";
    const auto again = frames.replace_damaged(three.get(), &first);
    ASSERT_TRUE(again);
    EXPECT_EQ(again->picture, two) << "request that still holds the frame";
    EXPECT_FALSE(first);
  }
}

TEST(CameraFrames, FirstDamagedFrameHasNoReplacement) {
  StartedFrames frames(kLive);
  const auto picture = std::make_shared<Compressed>();
  frames.push(compressed(0, picture));
  EXPECT_FALSE(frames.replace_damaged(picture.get()));
  EXPECT_FALSE(frames.find(0, true)->picture);
}

TEST(CameraFrames, FlushDropsFramesAndEnd) {
  StartedFrames frames(kFile);
  frames.push(frame(3));
  frames.end_stream();
  frames.set_flushing(true);
  EXPECT_EQ(frames.push(frame(4)), PushResult::kStopped);
  frames.set_flushing(false);
  EXPECT_EQ(frames.held(), 0u);
  EXPECT_EQ(frames.push(frame(9)), PushResult::kTaken);
  EXPECT_EQ(frames.find(9, true)->time, 9u);
}

std::shared_ptr<const Rig> rig_with(const std::vector<uint32_t>& ids) {
  Rig rig;
  for (const uint32_t id : ids) {
    Camera camera;
    camera.id = id;
    camera.width = camera.height = 8;
    camera.lens = Lens::pinhole(10, 3.5, 3.5);
    camera.pose.position = Vec3(0.1 * id, 0, 0);
    rig.cameras.push_back(camera);
  }
  return std::make_shared<const Rig>(std::move(rig));
}

CameraInputs::Frames input(CameraInputs& inputs, uint32_t id, PixelFamily family = PixelFamily::kI420) {
  const auto frames = std::make_shared<CameraFrames>();
  inputs.add(frames);
  EXPECT_TRUE(inputs.set_camera(frames, id));
  inputs.set_family(frames, family);
  return frames;
}

TEST(CameraInputs, KeepTheirIdsWhenTheRigChanges) {
  CameraInputs inputs;
  inputs.set_rig(rig_with({10, 11, 12}));
  const auto ten = input(inputs, 10), twelve = input(inputs, 12);
  const auto before = inputs.array();
  EXPECT_EQ(before->cameras.at(0), ten);
  EXPECT_EQ(before->cameras.at(2), twelve);
  EXPECT_MENTIONS(inputs.set_rig(rig_with({12, 13})), "camera 10");
  EXPECT_EQ(inputs.array()->cameras.size(), 1u);
  EXPECT_EQ(inputs.array()->cameras.at(0), twelve);
  EXPECT_EQ(before->cameras.size(), 2u) << "requests in progress are unaffected";
  EXPECT_EQ(inputs.camera(10), nullptr);
  EXPECT_EQ(inputs.set_rig(rig_with({9, 10, 11, 12})), "");
  EXPECT_EQ(inputs.array()->cameras.at(1), ten);
}

TEST(CameraInputs, CameraHasOneInput) {
  CameraInputs inputs;
  inputs.set_rig(rig_with({10, 11}));
  const auto first = input(inputs, 10);
  const auto second = std::make_shared<CameraFrames>();
  inputs.add(second);
  EXPECT_FALSE(inputs.set_camera(second, 10));
  inputs.remove(first);
  EXPECT_TRUE(inputs.set_camera(second, 10));
}

TEST(CameraInputs, FamilyIsRgbIfAnyInputIsRgb) {
  CameraInputs inputs;
  inputs.set_rig(rig_with({0, 1, 2, 3}));
  EXPECT_EQ(inputs.choose_family(), PixelFamily::kNone);
  input(inputs, 0);
  const auto rgb = input(inputs, 1, PixelFamily::kRgb);
  input(inputs, 2);
  EXPECT_EQ(inputs.choose_family(), PixelFamily::kRgb);
  inputs.remove(rgb);
  EXPECT_EQ(inputs.choose_family(), PixelFamily::kRgb);
  inputs.forget_family();
  EXPECT_EQ(inputs.choose_family(), PixelFamily::kI420);
}

TEST(CameraInputs, AreAwaitedUntilKnownOrCancelled) {
  CameraInputs inputs;
  inputs.set_rig(rig_with({0, 1}));
  inputs.set_running(true);
  std::atomic<bool> cancelled = false;
  for (int how = 0; how < 5; how++) {
    const auto frames = std::make_shared<CameraFrames>();
    inputs.add(frames);
    cancelled = false;
    std::thread waiting([&] { inputs.wait_for_all(cancelled); });
    switch (how) {
      case 0:
        inputs.set_family(frames, PixelFamily::kRgb);
        inputs.set_camera(frames, 1);
        break;
      case 1: inputs.give_up(frames); break;
      case 2: inputs.remove(frames); break;
      case 3:
        cancelled = true;
        inputs.wake();
        break;
      default: inputs.set_running(false);
    }
    waiting.join();
    inputs.remove(frames);
  }
}

TEST(CameraInputs, ChangeWhileTheRigIsReplaced) {
  CameraInputs inputs;
  const auto one = rig_with({0, 1, 2}), other = rig_with({2, 1});
  inputs.set_rig(one);
  const auto stays = input(inputs, 2);
  std::thread joining([&] {
    for (int i = 0; i < 500; i++) inputs.remove(input(inputs, 1));
  });
  std::thread replacing([&] {
    for (int i = 0; i < 500; i++) inputs.set_rig(i % 2 ? one : other);
  });
  for (int i = 0; i < 500; i++) {
    const auto array = inputs.array();
    EXPECT_EQ(array->rig_hash, array->rig->hash());
    EXPECT_EQ(array->cameras.at(*array->rig->index_of_id(2)), stays);
  }
  joining.join();
  replacing.join();
}

}  // namespace
}  // namespace lf
