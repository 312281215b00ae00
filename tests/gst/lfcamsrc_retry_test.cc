// SPDX-License-Identifier: LGPL-2.1-or-later
//
// One camera that fails, alone: an error, or with `retry` a gap in its stream.
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "gst/loss_fixture.h"

namespace lf::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class RetryTest : public LossTest {
 protected:
  static ElementPtr camera(const std::string& properties) {
    return launch("lfcamsrc name=camera " + properties + " ! fakesink name=sink sync=false");
  }
};

TEST_F(RetryTest, AnErrorStaysAnErrorWithoutIt) {
  failing_device(0).frames_at_most = 10;
  const ElementPtr pipeline = camera("trusted=true rig=" + devices(1));
  ASSERT_TRUE(pipeline);
  const Said said(pipeline.get());
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  EXPECT_TRUE(eventually([&] { return !said.errors().empty(); }));
  EXPECT_THAT(said.errors()[0], HasSubstr("failing://0: Device 0 is gone"));
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  EXPECT_EQ(said.lost(0), 0);
}

TEST_F(RetryTest, ADeviceThatFailsAfterTenFramesIsOpenedAgain) {
  failing_device(0).frames_at_most = 10;
  const ElementPtr pipeline = camera("retry=true trusted=true rig=" + devices(1));
  ASSERT_TRUE(pipeline);
  const Said said(pipeline.get());
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr sink = child(pipeline.get(), "sink"), camera = child(pipeline.get(), "camera");
  Pictures frames(sink.get());
  EXPECT_TRUE(eventually([&] { return frames.count() >= 30; }));
  EXPECT_GE(said.lost(0), 2);
  EXPECT_GE(said.found(0), 2);
  EXPECT_EQ(camera_stats(camera.get()).retries, static_cast<uint64_t>(said.found(0))) << "each attempt succeeds";
  failing_device(0).frames_at_most = 0;
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  EXPECT_EQ(camera_stats(camera.get()).state, "stopped");
  EXPECT_THAT(said.errors(), IsEmpty());
}

// After days nobody could run through what a film that loops has shown since.
TEST_F(RetryTest, AFilmThatLoopsIsTakenUpInItsRound) {
  const std::string late = files->path("late.mkv");
  const ElementPtr pipeline =
      camera("is-live=true loop=true retry=true rig=" + rig(1, [](guint) { return "late.mkv"; }));
  ASSERT_TRUE(pipeline);
  const Said said(pipeline.get());
  constexpr GstClockTime kRunning = 1000 * 3600 * GST_SECOND;
  GstClock* clock = GST_CLOCK(g_object_new(GST_TYPE_SYSTEM_CLOCK, "clock-type", GST_CLOCK_TYPE_REALTIME, nullptr));
  gst_pipeline_use_clock(GST_PIPELINE(pipeline.get()), clock);
  gst_element_set_start_time(pipeline.get(), GST_CLOCK_TIME_NONE);
  gst_element_set_base_time(pipeline.get(), gst_clock_get_time(clock) - kRunning);
  gst_object_unref(clock);
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr sink = child(pipeline.get(), "sink");
  Pictures frames(sink.get());
  EXPECT_TRUE(eventually([&] { return said.lost(0) == 1; }));
  std::filesystem::copy(files->path("mjpeg.mkv"), late);
  EXPECT_TRUE(eventually([&] { return said.found(0) == 1 && frames.count() > 5; }));
  g_autoptr(GstSample) sample = nullptr;
  g_object_get(sink.get(), "last-sample", &sample, nullptr);
  ASSERT_TRUE(sample);
  const GstClockTime shown = gst_segment_to_running_time(gst_sample_get_segment(sample), GST_FORMAT_TIME,
                                                         GST_BUFFER_PTS(gst_sample_get_buffer(sample)));
  EXPECT_GE(shown, kRunning);
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  EXPECT_THAT(said.errors(), IsEmpty());
  std::filesystem::remove(late);
}

// Viewers would wait for frames that are late because their film has to come to where it is in its round first.
TEST_F(RetryTest, AFilmThatComesBackIsNotLate) {
  const std::string late = files->path("late-long.mkv"), whole = files->path("whole-long.mkv");
  run_to_end(
      "videotestsrc num-buffers=60 ! video/x-raw,format=I420,width=64,height=48,framerate=15/1 ! jpegenc ! "
      "matroskamux ! filesink location=" +
      whole);
  const ElementPtr pipeline =
      camera("is-live=true loop=true retry=true rig=" + rig(1, [](guint) { return "late-long.mkv"; }));
  ASSERT_TRUE(pipeline);
  const Said said(pipeline.get());
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr sink = child(pipeline.get(), "sink");
  Pictures frames(sink.get());
  EXPECT_TRUE(eventually([&] { return said.lost(0) == 1; }));
  g_usleep(2'000'000);
  std::filesystem::copy(whole, late);
  EXPECT_TRUE(eventually([&] { return frames.count() > 0; }));
  g_autoptr(GstSample) first = nullptr;
  g_object_get(sink.get(), "last-sample", &first, nullptr);
  ASSERT_TRUE(first);
  const GstClockTime taken = gst_segment_to_running_time(gst_sample_get_segment(first), GST_FORMAT_TIME,
                                                         GST_BUFFER_PTS(gst_sample_get_buffer(first)));
  EXPECT_LT(gst_element_get_current_running_time(pipeline.get()), taken + GST_SECOND / 2);
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  EXPECT_THAT(said.errors(), IsEmpty());
}

// In PAUSED, too; and the end that an application asks for comes while there is no camera.
TEST_F(RetryTest, AMissingDeviceIsLiveAllTheSame) {
  failing_device(0).broken = true;
  const ElementPtr pipeline = camera("is-live=true retry=true trusted=true rig=" + devices(1));
  ASSERT_TRUE(pipeline);
  const Said said(pipeline.get());
  EXPECT_EQ(gst_element_set_state(pipeline.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_NO_PREROLL);
  EXPECT_EQ(said.lost(0), 1);
  const ElementPtr camera = child(pipeline.get(), "camera");
  EXPECT_TRUE(eventually([&] { return camera_stats(camera.get()).retries >= 1; }));
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  EXPECT_TRUE(gst_element_send_event(pipeline.get(), gst_event_new_eos()));
  EXPECT_TRUE(eventually([&] { return said.has_ended(); }));
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
}

// Of a file that is not live the frames after a gap follow those before it.
TEST_F(RetryTest, RunningTimeGoesOn) {
  const std::string path = rig(1, [](guint) { return "late.mkv"; });
  const ElementPtr pipeline = camera("retry=true rig=" + path);
  ASSERT_TRUE(pipeline);
  const Said said(pipeline.get());
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr sink = child(pipeline.get(), "sink");
  Pictures frames(sink.get());
  EXPECT_TRUE(eventually([&] { return said.lost(0) == 1; }));
  std::filesystem::copy(files->path("mjpeg.mkv"), files->path("late.mkv"));
  EXPECT_TRUE(eventually([&] { return said.has_ended(); })) << "at its end";
  EXPECT_EQ(said.found(0), 1);
  EXPECT_EQ(frames.count(), CameraFiles::kFrames);
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  std::filesystem::remove(files->path("late.mkv"));
}

TEST_F(RetryTest, ARigThatCanNotBeReadIsAnError) {
  const ElementPtr pipeline = camera("retry=true rig=" + files->path("none.json"));
  ASSERT_TRUE(pipeline);
  const Said said(pipeline.get());
  EXPECT_EQ(gst_element_set_state(pipeline.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
  EXPECT_THAT(said.errors(), ElementsAre(HasSubstr("none.json: no such file")));
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
}

}  // namespace
}  // namespace lf::test
