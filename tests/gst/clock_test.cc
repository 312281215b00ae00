// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Pipelines that share only a clock: each has its own base time.
#include <gst/app/gstappsrc.h>

#include "base/schedule.h"
#include "common/wall_clock.h"
#include "gst/array_fixture.h"
#include "support/answers.h"

namespace lf::test {
namespace {

bool play(GstElement* pipeline) {
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  return gst_element_get_state(pipeline, nullptr, nullptr, 20 * GST_SECOND) != GST_STATE_CHANGE_FAILURE;
}

struct Answers {
  std::mutex mutex;
  std::vector<wire::Answer> seen;
};

GstPadProbeReturn note_answer(GstPad*, GstPadProbeInfo* info, gpointer data) {
  auto* answers = static_cast<Answers*>(data);
  auto answer = wire::decode_answer(to_bytes(GST_PAD_PROBE_INFO_BUFFER(info)));
  std::lock_guard lock(answers->mutex);
  if (answer) answers->seen.push_back(std::move(*answer));
  return GST_PAD_PROBE_OK;
}

GstPadProbeReturn relay(GstPad*, GstPadProbeInfo* info, gpointer appsrc) {
  // appsrc sets new timestamps
  gst_app_src_push_buffer(GST_APP_SRC(appsrc), gst_buffer_copy(GST_PAD_PROBE_INFO_BUFFER(info)));
  return GST_PAD_PROBE_OK;
}

void probe(GstElement* pipeline, const char* element, const char* pad_name, GstPadProbeCallback callback,
           gpointer data) {
  const ElementPtr owner(gst_bin_get_by_name(GST_BIN(pipeline), element));
  GstPad* pad = gst_element_get_static_pad(owner.get(), pad_name);
  gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_BUFFER, callback, data, nullptr);
  gst_object_unref(pad);
}

// Node and viewer pipelines have different base times and share only the realtime clock, like hosts synchronised by
// chrony or PTP. The cameras capture on the schedule, so the skew is 0 except for late frames.
TEST(ClockSelect, NodeAndViewerMeetOnTheSchedule) {
  const ArrayFixture array;
  const std::string rig = " is-live=true framerate=5/1 rig=" + array.rig_path() + " ";
  const ElementPtr node = launch(
      "clockselect. ( clock-id=realtime appsrc name=in is-live=true format=time "
      "caps=application/x-lightfield-request ! lfcameranode name=n" +
      rig + "! fakesink sync=false async=false )");
  const ElementPtr viewer = launch("clockselect. ( clock-id=realtime lfviewrequest name=r capture-delay=1000000000" +
                                   rig + "! fakesink sync=false )");
  ASSERT_TRUE(viewer && node);
  ASSERT_TRUE(play(node.get()));
  ASSERT_TRUE(play(viewer.get()));
  EXPECT_NE(gst_element_get_base_time(viewer.get()), gst_element_get_base_time(node.get()));

  Answers answers;
  const ElementPtr in(gst_bin_get_by_name(GST_BIN(node.get()), "in"));
  probe(node.get(), "n", "src", note_answer, &answers);
  probe(viewer.get(), "r", "src", relay, in.get());
  const uint64_t half = Schedule(5, 1).period() / 2;
  size_t near = 0;
  for (int i = 0; i < 1200 && near < 10; i++) {
    g_usleep(50000);
    std::lock_guard lock(answers.mutex);
    near = 0;
    for (const wire::Answer& answer : answers.seen)
      near += answer.fragments.size() > 0 && answer.actual_time != kNoTime &&
              time_between(answer.actual_time, answer.target_time) <= half;
  }
  EXPECT_GE(near, 10u);
  gst_element_set_state(viewer.get(), GST_STATE_NULL);
  gst_element_set_state(node.get(), GST_STATE_NULL);
}

// In production, gst-launch-1.0 puts all elements on the realtime clock.
TEST(ClockSelect, RealtimeReachesRequestsAndFrames) {
  const ArrayFixture array;
  const std::string rig = " rig=" + array.rig_path() + " is-live=true framerate=5/1 ";
  const ElementPtr pipeline = launch("clockselect. ( clock-id=realtime lfviewrequest capture-delay=1000000000" + rig +
                                     "! lfcameranode name=n" + rig + "! fakesink sync=false )");
  ASSERT_TRUE(pipeline);
  Answers answers;
  probe(pipeline.get(), "n", "src", note_answer, &answers);
  const auto before = static_cast<uint64_t>(g_get_real_time()) * GST_USECOND;
  ASSERT_TRUE(play(pipeline.get()));
  size_t near = 0;
  for (int i = 0; i < 1200 && near < 5; i++) {
    g_usleep(50000);
    std::lock_guard lock(answers.mutex);
    near = 0;
    for (const wire::Answer& answer : answers.seen) {
      EXPECT_GT(answer.target_time + GST_SECOND, before);
      near += answer.actual_time == answer.target_time;  // the scene is captured on the schedule
    }
  }
  EXPECT_GE(near, 5u);
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
}

GstClockTimeDiff day_now() { return g_get_real_time() * GST_USECOND; }

// Shifts the clock by `step`, as if the time of day had been set.
void set_day(GstClock* clock, GstClockTimeDiff step) {
  GstClockTime internal, external, numerator, denominator;
  gst_clock_get_calibration(clock, &internal, &external, &numerator, &denominator);
  gst_clock_set_calibration(clock, internal, external - static_cast<GstClockTime>(step), numerator, denominator);
}

TEST(WallClock, StartsAtTheTimeOfDay) {
  g_autoptr(GstClock) clock = new_wall_clock();
  EXPECT_NEAR(static_cast<double>(gst_clock_get_time(clock)), static_cast<double>(day_now()), 1e8);
  EXPECT_EQ(wall_offset(clock), 0);
  g_autoptr(GstClock) other = gst_system_clock_obtain();
  EXPECT_EQ(wall_offset(other), 0) << "no offset for clocks selected by the application";
}

TEST(WallClock, ContinuesWhenTheTimeOfDayIsSet) {
  for (const GstClockTimeDiff step : {600 * GST_SECOND, -3600 * GST_SECOND, 50 * GST_MSECOND}) {
    g_autoptr(GstClock) clock = new_wall_clock();
    set_day(clock, step);
    EXPECT_NEAR(static_cast<double>(wall_offset(clock)), static_cast<double>(step), 2e6);
    EXPECT_NEAR(static_cast<double>(gst_clock_get_time(clock)) + static_cast<double>(wall_offset(clock)),
                static_cast<double>(day_now()), 1e8);
    const GstClockTime before = gst_clock_get_time(clock);
    g_usleep(2000);
    EXPECT_GT(gst_clock_get_time(clock), before);
  }
}

TEST(WallClock, StepIsReportedOnce) {
  const ElementPtr pipeline = launch("fakesrc name=e ! fakesink");
  g_autoptr(GstClock) clock = new_wall_clock();
  const ElementPtr e(gst_bin_get_by_name(GST_BIN(pipeline.get()), "e"));
  gst_element_set_clock(e.get(), clock);
  set_day(clock, -40 * static_cast<GstClockTimeDiff>(GST_SECOND));
  for (int i = 0; i < 5; i++) EXPECT_LT(wall_offset(e.get()), 0);
  g_autoptr(GstBus) bus = gst_element_get_bus(pipeline.get());
  const std::vector<std::string> told = all_warnings_on(bus);
  ASSERT_EQ(told.size(), 1u);
  EXPECT_NE(told[0].find("back by 40.0"), std::string::npos) << told[0];
}

TEST(Clocks, CamerasNodesAndRequestsProvideNoClock) {
  const ArrayFixture array;
  for (const std::string element : {"lfcamsrc", "lfcameranode", "lfviewrequest"}) {
    const ElementPtr pipeline =
        launch(element + " name=e is-live=true rig=" + array.rig_path() + " ! fakesink async=false");
    ASSERT_TRUE(pipeline);
    ASSERT_TRUE(play(pipeline.get())) << element;
    const ElementPtr e(gst_bin_get_by_name(GST_BIN(pipeline.get()), "e"));
    EXPECT_EQ(gst_element_provide_clock(e.get()), nullptr) << element;
    gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  }
}

}  // namespace
}  // namespace lf::test
