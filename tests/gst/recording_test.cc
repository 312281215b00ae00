// SPDX-License-Identifier: LGPL-2.1-or-later
#include <future>

#include <sys/stat.h>

#include "base/text.h"
#include "recording/recording.h"
#include "rig/rig_json.h"
#include "support/expect_error.h"
#include "support/recorded.h"
#include "support/temp_dir.h"

namespace lf::test {
namespace {

constexpr GstClockTime kBegin = 1'800'000'000 * GST_SECOND;

class CaptureTimelineTest : public testing::Test {
 protected:
  static constexpr gint64 kPeriod = 40 * GST_MSECOND;

  CaptureTimeline::Place at(uint32_t camera, gint64 clock) { return timeline_.place(camera, kBegin + clock); }
  gint64 time(uint32_t camera, gint64 clock) { return at(camera, clock).time; }

  CaptureTimeline timeline_{kBegin};
};

TEST_F(CaptureTimelineTest, TimesStartAtZero) {
  for (const uint32_t camera : {0, 1})
    for (gint64 i = 0; i < 5; i++) EXPECT_EQ(time(camera, i * kPeriod + camera), i * kPeriod + camera);
  EXPECT_EQ(time(2, -kPeriod), -kPeriod) << "before the start";
  EXPECT_EQ(time(0, 60 * GST_SECOND), gint64{60 * GST_SECOND}) << "the camera was lost";
  EXPECT_EQ(time(0, 59 * GST_SECOND + kPeriod), gint64{59 * GST_SECOND + kPeriod}) << "less than a second late";
}

TEST_F(CaptureTimelineTest, OutlierChangesNothing) {
  for (gint64 i = 0; i < 200; i++) {
    if (i % 50 == 40) {
      EXPECT_LT(time(0, (i - 30) * kPeriod), (i - 25) * kPeriod);
    }
    EXPECT_EQ(time(0, i * kPeriod), i * kPeriod);
  }
}

// Frames from before the change may arrive after the first frame from after the change.
TEST_F(CaptureTimelineTest, CamerasStaySynchronisedWhenTheClockIsSetBack) {
  constexpr gint64 kHour = 3600 * GST_SECOND;
  for (const gint64 back : {gint64{2 * GST_SECOND}, kHour}) {
    SCOPED_TRACE(back);
    timeline_ = CaptureTimeline(kBegin);
    const auto clock = [&](gint64 i) { return i * kPeriod - (i < 100 ? 0 : back); };
    for (gint64 i = 0; i < 200; i++) {
      const CaptureTimeline::Place first = at(0, clock(i));
      EXPECT_EQ(first.time, i * kPeriod - (i == 100 ? back : 0)) << "only the first may deviate";
      EXPECT_EQ(first.set_back, i == 101 ? back : 0);
      for (const gint64 behind : {1, 5})
        if (i >= behind) {
          const CaptureTimeline::Place other = at(behind, clock(i - behind) + 3);
          EXPECT_EQ(other.time, (i - behind) * kPeriod + 3) << behind;
          EXPECT_EQ(other.set_back, 0);
        }
    }
    EXPECT_EQ(time(9, clock(200)), 200 * kPeriod) << "late camera";
  }
}

TEST_F(CaptureTimelineTest, AbsentCameraIsSynchronisedAgain) {
  for (gint64 i = 0; i < 10; i++) EXPECT_EQ(time(1, i * kPeriod), i * kPeriod);
  constexpr gint64 kBack = 5 * GST_SECOND;
  const auto see = [&](gint64 i, gint64 back) {
    const gint64 seen = time(0, i * kPeriod - back);
    if (i != 100 && i != 1500 && i != 1700) {
      EXPECT_EQ(seen, i * kPeriod);
    }
  };
  for (gint64 i = 0; i < 1000; i++) see(i, i < 100 ? 0 : kBack);
  EXPECT_EQ(time(1, 1000 * kPeriod - kBack), 1000 * kPeriod);
  EXPECT_EQ(time(2, 1000 * kPeriod - kBack), 1000 * kPeriod) << "first frame";
  // The clock is set back twice more while camera 1 is silent.
  for (gint64 i = 1000; i < 2000; i++) see(i, kBack * (1 + i / 1500 + i / 1700));
  EXPECT_EQ(time(1, 2000 * kPeriod - 3 * kBack), 2000 * kPeriod);
}

// If only one camera's clock is wrong, only that camera's frames are moved behind its earlier ones.
TEST_F(CaptureTimelineTest, ClockStepOfOneCameraDoesNotAffectOthers) {
  for (gint64 i = 0; i < 200; i++) {
    EXPECT_EQ(time(0, i * kPeriod), i * kPeriod);
    const gint64 seen = time(1, i * kPeriod - (i < 100 ? 0 : 60 * GST_SECOND));
    if (i == 100) continue;
    EXPECT_EQ(seen, i * kPeriod);
  }
  EXPECT_EQ(time(0, 1000 * kPeriod), 1000 * kPeriod) << "after a gap";
  EXPECT_EQ(time(2, 1000 * kPeriod), 1000 * kPeriod) << "first frame";
}

// --- The files of a recording, fed without cameras -------------------------------------------------------------------

constexpr GstClockTime kPeriod = GST_SECOND / 30;

class RecordingTest : public testing::Test {
 protected:
  void SetUp() override {
    rig_ = make_grid_rig({.rows = 1, .columns = 3, .pitch = 0.1, .fov_y_deg = 40, .width = 64, .height = 48});
    for (Camera& camera : rig_.cameras) camera.time_offset = 0.25;
    save_rig(rig_, dir_ / "rig.json");
    rig_.directory = dir_.path();
  }
  std::unique_ptr<Recording> record(const std::string& folder) {
    return std::make_unique<Recording>(owner_.get(), dir_ / folder, rig_, dir_ / "rig.json",
                                       std::vector<CameraIndex>{0, 1, 2});
  }
  BufferPtr frame(size_t bytes = 1000) const { return BufferPtr(to_buffer(std::vector<uint8_t>(bytes, 7))); }
  GstCaps* jpeg() const { return jpeg_.get(); }
  // Returns the next warning, "" if there is none.
  std::string warning() const {
    const MessagePtr message(gst_bus_pop_filtered(bus_.get(), GST_MESSAGE_WARNING));
    return message ? text_of(message.get()) : "";
  }
  RecordedFile recorded(int camera) const { return read_recorded(dir_ / "r/camera" + std::to_string(camera) + ".mkv"); }

  // Calls add() with frame times until it returns true, for at most 20 seconds.
  static void add_until(const std::function<bool(GstClockTime)>& add) {
    const gint64 end = g_get_monotonic_time() + 20 * G_USEC_PER_SEC;
    for (GstClockTime time = GST_SECOND; !add(time) && g_get_monotonic_time() < end; time += kPeriod) g_usleep(10000);
  }

  TempDir dir_;
  Rig rig_;
  PipelinePtr owner_ = launch("fakesink");
  const ElementBus bus_{owner_.get()};
  CapsPtr jpeg_{gst_caps_from_string("image/jpeg,width=64,height=48,framerate=30/1")};
};

// Live: the first frame of any camera starts the recording.
TEST_F(RecordingTest, TimesAreCaptureTimesFromOneStart) {
  const auto recording = record("r");
  constexpr GstClockTime kBegin = 1'800'000'000 * GST_SECOND + 123'456'789;
  const auto add = [&](uint32_t camera, GstClockTime time) {
    recording->add(camera, frame().get(), jpeg(), kBegin + time, true);
  };
  add(0, 0);
  for (GstClockTime i = 1; i < 90; i++) add(0, i * kPeriod);
  for (GstClockTime i = 0; i < 30; i++) add(1, 7 * GST_SECOND + i * kPeriod);
  for (const GstClockTime gap : {0, 5})
    for (GstClockTime i = 0; i < 10; i++) add(2, gap * GST_SECOND + i * kPeriod + 3 * GST_MSECOND);
  add(2, 0);  // before the start of the recording
  const StructurePtr stats(recording->stats());
  guint64 begin = 0;
  EXPECT_TRUE(gst_structure_get_uint64(stats.get(), "begin", &begin));
  EXPECT_EQ(begin, kBegin);
  recording->finish();
  constexpr GstClockTime kTick = 10 * GST_USECOND;
  const auto expect_near = [=](GstClockTime a, GstClockTime b) { EXPECT_LE(a > b ? a - b : b - a, kTick); };
  const GstClockTime end = 7 * GST_SECOND + 30 * kPeriod;
  for (int camera = 0; camera < 3; camera++) {
    const RecordedFile file = recorded(camera);
    ASSERT_EQ(file.times.size(), camera == 0 ? 90u : camera == 1 ? 30u : 20u);
    expect_near(file.times.front(), camera == 0 ? 0 : camera == 1 ? 7 * GST_SECOND : 3 * GST_MSECOND);
    if (camera == 2) expect_near(file.times[10], 5 * GST_SECOND + 3 * GST_MSECOND);
    expect_near(file.end, end);  // all loop together
  }
}

// Frames from before the change may arrive after the first frame from after the change.
TEST_F(RecordingTest, ContinuesWhenTheClockIsSetBack) {
  const auto recording = record("r");
  constexpr GstClockTime kBegin = 1'800'000'000 * GST_SECOND, kHour = 3600 * GST_SECOND;
  const auto add = [&](uint32_t camera, GstClockTime i) {
    recording->add(camera, frame().get(), jpeg(), kBegin + i * kPeriod - (i < 10 ? 0 : kHour), true);
  };
  for (GstClockTime i = 0; i < 20; i++) {
    add(0, i);
    if (i > 0) add(1, i - 1);
    if (i > 14) add(2, i);
  }
  add(1, 19);
  recording->add(0, frame().get(), jpeg(), kBegin + 19 * kPeriod - kHour, true);
  EXPECT_EQ(recording->counts(0).frames, 19u);
  EXPECT_EQ(recording->counts(0).dropped, 2u) << "the first frame after the change, and the next";
  EXPECT_EQ(recording->counts(1).dropped, 0u);
  EXPECT_MENTIONS(warning(), "/r", "clock", "3600.0 s");
  EXPECT_EQ(warning(), "") << "one warning only";
  recording->finish();
  for (int camera = 0; camera < 3; camera++) {
    const std::vector<GstClockTime> times = recorded(camera).times;
    std::vector<GstClockTime> expected;
    for (GstClockTime i = camera == 2 ? 15 : 0; i < 20; i++)
      if (camera != 0 || i != 10) expected.push_back(i * kPeriod);
    ASSERT_EQ(times.size(), expected.size()) << camera;
    for (size_t i = 0; i < times.size(); i++)
      EXPECT_NEAR(static_cast<double>(times[i]), static_cast<double>(expected[i]), 1e4) << camera;
  }
}

TEST_F(RecordingTest, EarlyFramesAreCounted) {
  const auto recording = record("r");
  for (const GstClockTime time : {20, 18, 22})
    recording->add(time == 20 ? 0 : 1, frame().get(), jpeg(), time * GST_SECOND, true);
  EXPECT_EQ(recording->counts(1).frames, 1u);
  EXPECT_EQ(recording->counts(1).dropped, 1u);
}

TEST_F(RecordingTest, RigNamesTheFiles) {
  rig_.cameras[1].image = "still.png";
  const auto recording = record("deep/down");
  const Rig recorded = load_rig(dir_ / "deep/down/rig.json");
  EXPECT_EQ(recorded.hash(), rig_.hash());
  EXPECT_EQ(recorded.cameras[2].source, "camera2.mkv");
  EXPECT_EQ(recorded.cameras[1].image, "") << "stills are not copied";
  EXPECT_EQ(recorded.cameras[1].time_offset, 0) << "included in the files' times";
  rig_.cameras[0].lens = Lens::pinhole(77, 31.5, 23.5);
  recording->update_rig(rig_, dir_ / "rig.json");
  EXPECT_EQ(load_rig(dir_ / "deep/down/rig.json").hash(), rig_.hash());
}

TEST_F(RecordingTest, NothingIsOverwritten) {
  dir_.write("a/rig.json", "mine");
  EXPECT_ERROR(record("a"), "/a", "recording", "rig.json");
  EXPECT_EQ(std::filesystem::file_size(dir_ / "a/rig.json"), 4u);
  dir_.write("b/camera1.mkv", "mine, too");
  EXPECT_ERROR(record("b"), "(camera1.mkv)");
  EXPECT_FALSE(std::filesystem::exists(dir_ / "b/rig.json"));
  dir_.write("file", "");
  EXPECT_ERROR(record("file/r"), "can't be made");
  EXPECT_NO_THROW(record("c"));
  EXPECT_NO_THROW(record("c")) << "an empty recording can be replaced";
}

// A pipe without a reader acts as a disk that hangs.
TEST_F(RecordingTest, HangingDiskDoesNotBlock) {
  auto recording = record("r");
  ASSERT_EQ(mkfifo((dir_ / "r/camera1.mkv").c_str(), 0600), 0);
  const gint64 start = g_get_monotonic_time();
  constexpr size_t kBytes = 1 << 20;
  constexpr int kFrames = 200;
  for (GstClockTime i = 0; i < kFrames; i++) {
    recording->add(1, frame(kBytes).get(), jpeg(), i * kPeriod, true);
    recording->add(2, frame().get(), jpeg(), i * kPeriod, true);
  }
  const CameraFile::Counts hanging = recording->counts(1), other = recording->counts(2);
  EXPECT_EQ(hanging.frames + hanging.dropped, kFrames);
  EXPECT_GT(hanging.frames, 60u) << "a third of 256 MB queued";
  EXPECT_LT(hanging.frames, 90u);
  EXPECT_EQ(other.dropped, 0u);
  EXPECT_THAT(warning(), AllOf(mentions("/r", "disk", "slow"), HasSubstr("camera 1 (cam_00_01)")));
  EXPECT_EQ(warning(), "") << "one warning only";
  recording.reset();
  EXPECT_LT(g_get_monotonic_time() - start, 60 * G_USEC_PER_SEC);
  EXPECT_EQ(recorded(2).times.size(), size_t{kFrames});
  // Unblocks the thread that opens the pipe.
  const PipelinePtr reader = launch("filesrc location=" + dir_ / "r/camera1.mkv" + " ! fakesink");
  gst_element_set_state(reader.get(), GST_STATE_PLAYING);
  g_usleep(200000);
}

TEST_F(RecordingTest, UnwritableFolderStopsAndIsReportedOnce) {
  const auto recording = record("r");
  std::filesystem::remove_all(dir_ / "r");
  MessagePtr message;
  add_until([&](GstClockTime time) {
    for (uint32_t camera = 0; camera < 3; camera++) recording->add(camera, frame().get(), jpeg(), time, true);
    message.reset(gst_bus_pop_filtered(bus_.get(), GST_MESSAGE_ELEMENT));
    return message != nullptr;
  });
  ASSERT_TRUE(message);
  EXPECT_TRUE(gst_message_has_name(message.get(), "lightfield-recording-stopped"));
  const GstStructure* stopped = gst_message_get_structure(message.get());
  EXPECT_STREQ(gst_structure_get_string(stopped, "folder"), (dir_ / "r").c_str());
  EXPECT_THAT(gst_structure_get_string(stopped, "reason"), HasSubstr("r/camera"));
  recording->finish();
  EXPECT_THAT(warning(), HasSubstr("recording has stopped"));
  EXPECT_EQ(warning(), "");
}

// The folder is writable, so only one camera's file fails.
TEST_F(RecordingTest, FailingFileEndsAlone) {
  const auto recording = record("r");
  std::filesystem::create_directories(dir_ / "r/camera1.mkv");
  std::string told;
  GstClockTime last = 0;
  add_until([&](GstClockTime time) {
    for (const uint32_t camera : {0, 1}) recording->add(camera, frame().get(), jpeg(), last = time, true);
    return !(told = warning()).empty();
  });
  EXPECT_THAT(told, AllOf(mentions("camera 1", "cam_00_01", "recorded"), HasSubstr("/r/camera1.mkv: ")));
  const uint64_t dropped = recording->counts(1).dropped;
  for (GstClockTime i = 1; i <= 10; i++)
    for (uint32_t camera = 0; camera < 3; camera++)
      recording->add(camera, frame().get(), jpeg(), last + i * kPeriod, true);
  EXPECT_EQ(recording->counts(1).dropped, dropped + 10);
  const uint64_t frames = recording->counts(0).frames;
  recording->finish();
  EXPECT_GT(frames, 10u);
  EXPECT_EQ(recorded(0).times.size(), frames);
  EXPECT_EQ(recorded(2).times.size(), 10u) << "late camera";
  EXPECT_EQ(warning(), "") << "no second warning";
}

// Applications may stop the recording from the callback.
TEST_F(RecordingTest, MayBeFinishedInTheStopHandler) {
  struct Told {
    Recording* recording;
    std::future<void> finished;
    std::atomic<int> in_time = -1;
  } told{record("r").release(), {}, -1};
  const std::unique_ptr<Recording> owner(told.recording);
  gst_bus_set_sync_handler(
      bus_.get(),
      [](GstBus*, GstMessage* message, gpointer data) {
        auto& told = *static_cast<Told*>(data);
        if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ELEMENT) {
          told.finished = std::async(std::launch::async, [&told] { told.recording->finish(); });
          told.in_time = told.finished.wait_for(std::chrono::seconds(20)) == std::future_status::ready;
        }
        return GST_BUS_PASS;
      },
      &told, nullptr);
  std::filesystem::remove_all(dir_ / "r");
  add_until([&](GstClockTime time) {
    told.recording->add(0, frame().get(), jpeg(), time, true);
    return told.in_time >= 0;
  });
  EXPECT_EQ(told.in_time, 1);
  gst_bus_set_sync_handler(bus_.get(), nullptr, nullptr, nullptr);
}

TEST_F(RecordingTest, RawVideoIsEncoded) {
  const auto recording = record("r");
  const auto raw = [](int framerate) {
    return CapsPtr(gst_caps_from_string(
        ("video/x-raw,format=RGB,width=64,height=48,framerate=" + std::to_string(framerate) + "/1").c_str()));
  };
  for (GstClockTime i = 0; i < 10; i++)
    recording->add(0, frame(64 * 48 * 3).get(), raw(i < 5 ? 30 : 15).get(), i * kPeriod, true);
  EXPECT_EQ(recording->counts(0).frames, 10u);
  EXPECT_EQ(recording->counts(0).dropped, 0u);
  for (GstClockTime i = 0; i < 10; i++) recording->add(1, frame().get(), jpeg(), i * kPeriod, true);
  recording->finish();
  EXPECT_EQ(recorded(0).times.size(), 10u);
  EXPECT_EQ(recorded(1).times.size(), 10u);
  EXPECT_EQ(warning(), "");
}

// VP8: the recording does not parse its pictures.
TEST_F(RecordingTest, CodedVideoResumesWithKeyFrames) {
  const auto recording = record("r");
  const CapsPtr coded(gst_caps_from_string("video/x-vp8,width=64,height=48,framerate=30/1"));
  GstClockTime time = 0;
  const auto add = [&](bool key, GstCaps* caps = nullptr, GstClockTime back = 0) {
    const BufferPtr picture = frame();
    if (!key) GST_BUFFER_FLAG_SET(picture.get(), GST_BUFFER_FLAG_DELTA_UNIT);
    recording->add(0, picture.get(), caps ? caps : coded.get(), (time += kPeriod) - back, true);
    return recording->counts(0).frames;
  };
  EXPECT_EQ(add(false), 0u) << "needs reference frames";
  EXPECT_EQ(add(true), 1u);
  EXPECT_EQ(add(false), 2u);
  EXPECT_EQ(add(true, jpeg()), 2u);
  EXPECT_THAT(warning(), HasSubstr("changed to image/jpeg"));
  EXPECT_EQ(add(false), 2u) << "a reference frame is missing";
  EXPECT_EQ(add(true), 3u);
  EXPECT_EQ(add(true, nullptr, 10 * kPeriod), 3u) << "displayed before its predecessor";
  EXPECT_EQ(add(false), 3u);
  EXPECT_EQ(add(true), 4u);
  EXPECT_EQ(add(false), 5u);
  EXPECT_EQ(add(false), 6u);
  EXPECT_EQ(recording->counts(0).dropped, 5u);
  recording->finish();
  const RecordedFile file = recorded(0);
  EXPECT_EQ(file.kind, "video/x-vp8");
  ASSERT_EQ(file.keys.size(), 6u);
  EXPECT_EQ(std::vector(file.keys.begin(), file.keys.end() - 1), (std::vector{true, false, true, true, false}))
      << "the muxer marks the last frame only";
  EXPECT_EQ(warning(), "");
}

// Decoding order differs from display order, and the key frame precedes the start of the recording.
TEST_F(RecordingTest, CodedVideoKeepsItsOrder) {
  const auto recording = record("r");
  const CapsPtr coded(gst_caps_from_string("video/x-vp8,width=64,height=48,framerate=30/1"));
  constexpr GstClockTime kBegin = 1000 * GST_SECOND;
  recording->add(1, frame().get(), jpeg(), kBegin, true);
  for (const int number : {-2, 1, -1, 0, 4, 2, 3}) {
    const BufferPtr picture = frame();
    if (number > -2) GST_BUFFER_FLAG_SET(picture.get(), GST_BUFFER_FLAG_DELTA_UNIT);
    recording->add(0, picture.get(), coded.get(), kBegin + kPeriod * 3 / 2 + kPeriod * (number - 1), true);
  }
  recording->add(1, frame().get(), jpeg(), kBegin + GST_SECOND, true);
  recording->finish();
  const RecordedFile file = recorded(0);
  std::vector<double> periods;
  for (const GstClockTime time : file.times) periods.push_back(static_cast<double>(time) / kPeriod);
  const std::vector<double> expected = {0, 1.5, 0, 0.5, 4.5, 2.5, 3.5};
  ASSERT_EQ(periods.size(), expected.size());
  for (size_t i = 0; i < expected.size(); i++) EXPECT_NEAR(periods[i], expected[i], 0.001) << i;
  EXPECT_NEAR(static_cast<double>(file.end), static_cast<double>(recorded(1).end), 2e4)
      << "the last displayed picture lasts to the end";
}

TEST_F(RecordingTest, ChangeOfCodecIsReported) {
  const auto recording = record("r");
  const CapsPtr raw(gst_caps_from_string("video/x-raw,format=RGB,width=64,height=48,framerate=30/1"));
  const auto add = [&](uint32_t camera, bool is_raw, GstClockTime number) {
    recording->add(camera, frame(64 * 48 * 3).get(), is_raw ? raw.get() : jpeg(), number * kPeriod, true);
  };
  for (const uint32_t camera : {0, 1}) {
    const bool first = camera == 0;
    add(camera, first, 1);
    for (GstClockTime i = 2; i < 5; i++) add(camera, !first, i);
    add(camera, first, 5);
    EXPECT_EQ(recording->counts(camera).frames, 2u);
    EXPECT_EQ(recording->counts(camera).dropped, 3u);
    EXPECT_THAT(warning(), AllOf(mentions(first ? "cam_00_00" : "cam_00_01", first ? "image/jpeg" : "video/x-raw"),
                                 Not(HasSubstr("too slow"))));
    EXPECT_EQ(warning(), "") << "one warning only";
  }
}

}  // namespace
}  // namespace lf::test
