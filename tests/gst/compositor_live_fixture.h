// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/check/gsttestclock.h>

#include <string>
#include <utility>
#include <vector>

#include "common/view_feedback.h"
#include "gst/compositor_fixture.h"

namespace lf::test {

inline constexpr uint64_t kNow = 1000 * GST_SECOND, kLatency = 40 * GST_MSECOND;

// Live, on a clock that stands still unless a test moves it: what comes out without that was not waited for.
class LfCompositorLiveTest : public LfCompositorTest {
 protected:
  void start_live(int nodes, const std::vector<std::pair<std::string, std::string>>& properties = {}) {
    start(nodes, properties);
    g_object_set(element_.get(), "latency", kLatency, nullptr);
    gst_harness_set_live(harness_.get(), TRUE);
    for (const HarnessPtr& node : nodes_) gst_harness_set_live(node.get(), TRUE);
    gst_harness_use_testclock(harness_.get());
    gst_harness_set_time(harness_.get(), kNow);
    gst_harness_query_latency(harness_.get());
  }

  ViewRequest ask(const CameraSet& out_of_service = {}) {
    ViewRequest asked = array_.request(sequence_, kNow + sequence_ * kFrame);
    sequence_++;
    asked.out_of_service = out_of_service;
    gst_harness_set_time(harness_.get(), asked.target_time);
    request(asked);
    return asked;
  }

  // The deadline of the request asked for last passes.
  void pass_deadline() { gst_harness_set_time(harness_.get(), kNow + (sequence_ - 1) * kFrame + kLatency); }

  // What comes out while the clock stands still.
  std::vector<uint8_t> pull() {
    settle(5000);
    return gst_harness_buffers_in_queue(harness_.get()) > 0 ? LfCompositorTest::pull() : std::vector<uint8_t>{};
  }

  // Lets the compositor do what it can for so many milliseconds, or until a picture is out. (A test clock lets nobody
  // go on by itself, not even from the past.)
  void settle(int milliseconds) {
    GstTestClock* clock = gst_harness_get_testclock(harness_.get());
    for (int i = 0; i < milliseconds && gst_harness_buffers_in_queue(harness_.get()) == 0; i++) {
      GstClockID id = nullptr;
      if (gst_test_clock_peek_next_pending_id(clock, &id)) {
        if (gst_clock_id_get_time(id) <= gst_clock_get_time(GST_CLOCK(clock)))
          gst_clock_id_unref(gst_test_clock_process_next_clock_id(clock));
        gst_clock_id_unref(id);
      }
      g_usleep(1000);
    }
    gst_object_unref(clock);
  }

  // The sets that were announced since the last call.
  std::vector<CameraSet> announced() {
    std::vector<CameraSet> sets;
    while (GstEvent* event = gst_harness_try_pull_upstream_event(harness_.get())) {
      const std::optional<ViewFeedback> feedback = parse_view_feedback(event);
      if (feedback && feedback->out_of_service && feedback->view_id == 0) sets.push_back(*feedback->out_of_service);
      gst_event_unref(event);
    }
    return sets;
  }

  uint32_t sequence_ = 0;
};

}  // namespace lf::test
