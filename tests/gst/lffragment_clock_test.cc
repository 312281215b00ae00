// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <random>

#include "base/schedule.h"
#include "common/capture_delay.h"
#include "common/day_clock.h"
#include "gst/fragment_fixture.h"
#include "support/seeing.h"

namespace lf::test {
namespace {

using testing::HasSubstr;

// A request and live frames in clock time, in a pipeline that started at `base` on that clock.
class LfFragmentClockTest : public LfFragmentTest {
 protected:
  static constexpr uint64_t kEpoch = 1'700'000'000ull * GST_SECOND;  // as a realtime clock shows

  void start_at(uint64_t base, int cameras) {
    start(cameras, "RGB", true);
    listen();
    gst_element_set_base_time(element_.get(), base);
    base_ = base;
  }
  void push_taken(size_t camera, uint64_t clock_time) {
    ASSERT_EQ(gst_harness_push(cameras_[camera].get(), ArrayFixture::frame("RGB", 200, clock_time - base_)),
              GST_FLOW_OK);
  }
  wire::Answer ask(uint32_t sequence, uint64_t clock_time) {
    ViewRequest asked = array_.request(sequence, clock_time);
    asked.absolute_time = true;
    EXPECT_EQ(request(asked), GST_FLOW_OK);
    return pull();
  }
  uint64_t base_ = 0;
};

TEST_F(LfFragmentClockTest, TimesAreTheClocksWhateverTheBaseTime) {
  for (const uint64_t base : {kEpoch - 3 * GST_SECOND, kEpoch - 3600 * GST_SECOND + 12345, uint64_t{0}}) {
    cameras_.clear();
    harness_.reset();
    start_at(base, 4);
    for (uint64_t k = 0; k < 4; k++)
      for (size_t i = 0; i < 4; i++) push_taken(i, kEpoch + k * kFrame + 7 * GST_MSECOND);
    const wire::Answer answer = ask(0, kEpoch + kFrame);
    EXPECT_EQ(answer.target_time, kEpoch + kFrame);
    EXPECT_EQ(answer.actual_time, kEpoch + kFrame + 7 * GST_MSECOND) << base;
    EXPECT_EQ(seeing(answer).size(), 4u);
  }
}

// Somebody has set the time of day back by 40 s since the frames' pipeline began: requests name the new time.
TEST_F(LfFragmentClockTest, RequestsNameTheTimeOfDayThatWasSet) {
  g_autoptr(GstClock) clock = new_day_clock();
  GstClockTime internal, external, numerator, denominator;
  gst_clock_get_calibration(clock, &internal, &external, &numerator, &denominator);
  gst_clock_set_calibration(clock, internal, external + 40 * GST_SECOND, numerator, denominator);
  start_at(kEpoch - 3 * GST_SECOND, 4);
  gst_element_set_clock(element_.get(), clock);
  const GstClockTimeDiff offset = day_offset(clock);
  ASSERT_NEAR(static_cast<double>(offset), -40e9, 1e7);
  for (uint64_t k = 0; k < 4; k++)
    for (size_t i = 0; i < 4; i++) push_taken(i, kEpoch + k * kFrame + 7 * GST_MSECOND);
  const wire::Answer answer = ask(0, kEpoch + kFrame + static_cast<uint64_t>(offset));
  EXPECT_EQ(answer.target_time, kEpoch + kFrame + static_cast<uint64_t>(offset));
  EXPECT_EQ(answer.actual_time, kEpoch + kFrame + 7 * GST_MSECOND + static_cast<uint64_t>(offset));
  EXPECT_EQ(seeing(answer).size(), 4u);
}

// Cameras that nothing holds to the schedule: each has a rate, a phase and a latency of its own and loses frames. The
// nearest frame is used: within half of the distance between the two frames taken around the time asked for, which is
// half a frame time, and a whole one where the nearest was lost.
TEST_F(LfFragmentClockTest, FreeRunningCamerasStayWithinHalfAFrame) {
  const double rates[] = {29.7, 29.9, 30.1, 30.3};
  constexpr uint64_t kDelay = 110 * GST_MSECOND;  // request after the time it asks for; frames take up to 70 ms
  std::mt19937 random(5);
  const auto chance = [&random] { return std::uniform_real_distribution<>(0, 1)(random); };
  for (const double loss : {0.0, 0.03}) {
    cameras_.clear();
    harness_.reset();
    start_at(kEpoch - 1234567891, 4);
    struct Event {
      uint64_t when;
      size_t camera;  // 4: a request
      uint64_t time;  // taken or wanted
    };
    std::vector<Event> events;
    std::vector<uint64_t> taken[4];
    for (size_t i = 0; i < 4; i++) {
      uint64_t arrived = 0;
      const double phase = chance(), latency = 40e6 * chance();
      for (int k = 0; k < 400; k++) {
        const auto time = kEpoch + static_cast<uint64_t>((k + phase) * 1e9 / rates[i]);
        if (chance() < loss) continue;
        arrived = std::max(arrived, time + static_cast<uint64_t>(latency + 30e6 * chance()));
        taken[i].push_back(time);
        events.push_back({arrived, i, time});
      }
    }
    const Schedule schedule(30, 1);
    const uint64_t first = schedule.first_from(kEpoch + GST_SECOND);
    for (uint64_t k = first; k < first + 330; k++)
      events.push_back({schedule.instant(k) + kDelay, 4, schedule.instant(k)});
    std::stable_sort(events.begin(), events.end(), [](const Event& a, const Event& b) { return a.when < b.when; });

    const auto slowest = static_cast<uint64_t>(1e9 / rates[0]);
    uint64_t worst = 0;
    size_t requests = 0, within_half = 0;
    for (const Event& event : events) {
      if (event.camera < 4) {
        push_taken(event.camera, event.time);
        continue;
      }
      const wire::Answer answer = ask(static_cast<uint32_t>(requests++), event.time);
      ASSERT_EQ(seeing(answer).size(), 4u);
      uint64_t expected = 0, gap = 0;
      for (const std::vector<uint64_t>& times : taken) {
        const auto after = std::lower_bound(times.begin(), times.end(), event.time);
        ASSERT_TRUE(after != times.begin() && after != times.end());
        expected = std::max(expected, std::min(*after - event.time, event.time - *(after - 1)));
        gap = std::max(gap, *after - *(after - 1));
      }
      const uint64_t skew = time_between(answer.actual_time, event.time);
      ASSERT_EQ(skew, expected) << requests;
      ASSERT_LE(skew, gap / 2 + 1) << requests;
      within_half += skew <= slowest / 2 + 1;
      worst = std::max(worst, skew);
    }
    std::printf(
        "%.0f %% of frames lost: worst skew of an answer %.2f ms, %.1f %% of answers within half a frame time\n",
        100 * loss, static_cast<double>(worst) / 1e6, 100.0 * within_half / requests);
    EXPECT_EQ(stat(element_.get(), "max-skew-ns"), worst);
    if (loss == 0) {
      EXPECT_EQ(within_half, requests);
    }
    EXPECT_LT(worst, 3 * slowest);
    EXPECT_TRUE(warnings().empty()) << "lost frames are no reason for one";
  }
}

// A live viewer is told what the slowest camera needs: what its frames take, and half a frame.
TEST_F(LfFragmentClockTest, TellsTheCaptureDelayThatCamerasNeed) {
  start_at(kEpoch, 2);
  gst_harness_set_live(harness_.get(), TRUE);
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  gst_harness_push_event(harness_.get(), gst_event_new_segment(&segment));
  gst_harness_use_testclock(harness_.get());
  for (uint64_t k = 0; k < 5; k++) {
    gst_harness_set_time(harness_.get(), kEpoch + k * kFrame + 20 * GST_MSECOND);
    push_taken(0, kEpoch + k * kFrame);
    gst_harness_set_time(harness_.get(), kEpoch + k * kFrame + 70 * GST_MSECOND);
    push_taken(1, kEpoch + k * kFrame);
  }
  ask(0, kEpoch + 4 * kFrame);
  GstClockTime told = 0, delay = 0;
  while (GstEvent* event = gst_harness_try_pull_upstream_event(harness_.get())) {
    if (parse_capture_delay(event, &delay)) told = delay;
    gst_event_unref(event);
  }
  EXPECT_EQ(told, 70 * GST_MSECOND + kFrame / 2);
}

TEST_F(LfFragmentClockTest, ACameraThatStoppedIsBlind) {
  start_at(kEpoch, 4);
  const auto at = [](uint64_t k) { return kEpoch + k * kFrame; };
  for (uint64_t k = 0; k < 5; k++)
    for (size_t i = 0; i < 4; i++) push_taken(i, at(k));
  for (uint64_t k = 5; k < 20; k++) {  // camera 2 has stopped
    for (const size_t i : {0, 1, 3}) push_taken(i, at(k));
    const wire::Answer answer = ask(static_cast<uint32_t>(k), at(k));
    const bool stale = k > 4 + 5;  // 500 ms
    EXPECT_EQ(answer.cameras.size(), 4u) << k;
    EXPECT_EQ(answer.blind.contains(2), stale) << k;
    EXPECT_EQ(answer.actual_time, stale ? at(k) : at(4)) << k;
  }
  EXPECT_EQ(stat(element_.get(), "stale-frames"), 10u);
  EXPECT_EQ(stat(element_.get(), "missing-frames"), 10u);
  EXPECT_THAT(warnings(), testing::ElementsAre(testing::AllOf(HasSubstr("node 7 is off"), HasSubstr("camera 2 "),
                                                              HasSubstr("a frame (100 ms)"), HasSubstr("too old"))));
  ViewRequest without = array_.request(20, at(19));
  without.absolute_time = true;
  without.out_of_service = {2};
  ASSERT_EQ(request(without), GST_FLOW_OK);
  EXPECT_EQ(pull().blind, CameraRanges(CameraSet{2})) << "nor may it come back before it has frames";
  set("max-skew", "0");
  EXPECT_TRUE(ask(20, at(20)).blind.empty()) << "any frame is good enough";
}

TEST_F(LfFragmentClockTest, ANodeThatIsOffIsNamedOnce) {
  start_at(kEpoch, 4);
  for (uint64_t k = 0; k < 30; k++) {  // its clock is ahead of the viewer's
    for (size_t i = 0; i < 4; i++) push_taken(i, kEpoch + k * kFrame + 700 * GST_MSECOND);
    ask(static_cast<uint32_t>(k), kEpoch + k * kFrame);
  }
  EXPECT_THAT(warnings(), testing::ElementsAre(testing::AllOf(HasSubstr("node 7 is off"),
                                                              HasSubstr("camera 0, 1, 2, 3 "), HasSubstr("too new"))));
}

}  // namespace
}  // namespace lf::test
