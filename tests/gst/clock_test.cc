// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Pipelines that share only a clock: each has its own base time.
#include <gst/app/gstappsrc.h>

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

void note_answers(GstElement* node, Answers& answers) {
  on_buffers(node, "src", [&answers](GstBuffer* buffer) {
    auto answer = wire::decode_answer(to_bytes(buffer));
    std::lock_guard lock(answers.mutex);
    if (answer) answers.seen.push_back(std::move(*answer));
  });
}

// Node and viewer pipelines have different base times and share only the realtime clock, like hosts synchronised by
// chrony or PTP. The cameras capture on the schedule, so the skew is 0 except for late frames.
TEST(ClockSelect, NodeAndViewerMeetOnTheSchedule) {
  const ArrayFixture array;
  const std::string rig = " is-live=true framerate=5/1 rig=" + array.rig_path() + " ";
  const PipelinePtr node = launch(
      "clockselect. ( clock-id=realtime appsrc name=in is-live=true format=time "
      "caps=application/x-lightfield-request ! lfcameranode name=n" +
      rig + "! fakesink sync=false async=false )");
  const PipelinePtr viewer = launch("clockselect. ( clock-id=realtime lfviewrequest name=r capture-delay=1000000000" +
                                    rig + "! fakesink sync=false )");
  ASSERT_TRUE(play(node.get()));
  ASSERT_TRUE(play(viewer.get()));
  EXPECT_NE(gst_element_get_base_time(viewer.get()), gst_element_get_base_time(node.get()));

  Answers answers;
  const ElementPtr in = child_of(node.get(), "in");
  note_answers(child_of(node.get(), "n").get(), answers);
  on_buffers(child_of(viewer.get(), "r").get(), "src", [&](GstBuffer* buffer) {
    gst_app_src_push_buffer(GST_APP_SRC(in.get()), gst_buffer_copy(buffer));  // appsrc sets new timestamps
  });
  const uint64_t half = Schedule(5, 1).period() / 2;
  const auto is_near = [half](const wire::Answer& answer) {
    return answer.fragments.size() > 0 && answer.actual_time != kNoTime &&
           time_between(answer.actual_time, answer.target_time) <= half;
  };
  EXPECT_TRUE(eventually([&] {
    std::lock_guard lock(answers.mutex);
    return std::ranges::count_if(answers.seen, is_near) >= 10;
  }));
  gst_element_set_state(viewer.get(), GST_STATE_NULL);
  gst_element_set_state(node.get(), GST_STATE_NULL);
}

// In production, gst-launch-1.0 puts all elements on the realtime clock.
TEST(ClockSelect, RealtimeReachesRequestsAndFrames) {
  const ArrayFixture array;
  const std::string rig = " rig=" + array.rig_path() + " is-live=true framerate=5/1 ";
  const PipelinePtr pipeline = launch("clockselect. ( clock-id=realtime lfviewrequest capture-delay=1000000000" + rig +
                                      "! lfcameranode name=n" + rig + "! fakesink sync=false )");
  Answers answers;
  note_answers(child_of(pipeline.get(), "n").get(), answers);
  const auto before = static_cast<uint64_t>(g_get_real_time()) * GST_USECOND;
  ASSERT_TRUE(play(pipeline.get()));
  EXPECT_TRUE(eventually([&] {
    std::lock_guard lock(answers.mutex);
    for (const wire::Answer& answer : answers.seen) EXPECT_GT(answer.target_time + GST_SECOND, before);
    // The scene is captured on the schedule.
    return std::ranges::count_if(answers.seen, [](const auto& a) { return a.actual_time == a.target_time; }) >= 5;
  }));
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
  const PipelinePtr pipeline = launch("fakesrc name=e ! fakesink");
  g_autoptr(GstClock) clock = new_wall_clock();
  const ElementPtr e = child_of(pipeline.get(), "e");
  gst_element_set_clock(e.get(), clock);
  set_day(clock, -40 * static_cast<GstClockTimeDiff>(GST_SECOND));
  for (int i = 0; i < 5; i++) EXPECT_LT(wall_offset(e.get()), 0);
  g_autoptr(GstBus) bus = gst_element_get_bus(pipeline.get());
  EXPECT_THAT(all_warnings_on(bus), ElementsAre(HasSubstr("back by 40.0")));
}

TEST(Clocks, CamerasNodesAndRequestsProvideNoClock) {
  const ArrayFixture array;
  for (const std::string element : {"lfcamsrc", "lfcameranode", "lfviewrequest"}) {
    const PipelinePtr pipeline =
        launch(element + " name=e is-live=true rig=" + array.rig_path() + " ! fakesink async=false");
    ASSERT_TRUE(play(pipeline.get())) << element;
    EXPECT_EQ(gst_element_provide_clock(child_of(pipeline.get(), "e").get()), nullptr) << element;
  }
}

}  // namespace
}  // namespace lf::test
