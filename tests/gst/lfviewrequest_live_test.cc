// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/capture_delay.h"
#include "common/view_feedback.h"
#include "gst/other_rig.h"
#include "gst/view_request_source.h"

namespace lf::test {
namespace {

TEST(LfViewRequestLive, RequestsFollowTheCaptureSchedule) {
  Source source;
  source.set("framerate", 15, 1, "capture-delay", 50 * kMs);
  const GstClockTime second = 1'700'000'000ull * GST_SECOND;  // as a realtime clock shows
  gst_element_set_base_time(source.element(), second + 10 * kMs);
  source.play_live(second + 10 * kMs);
  for (int i = 0; i < 40; i++) {
    const Unit unit = source.next_live();
    // The first instant that is not before the start, and 50 ms old when it is asked for.
    const GstClockTime instant = second + gst_util_uint64_scale(i + 1, GST_SECOND, 15);
    EXPECT_EQ(unit.request.target_time, instant) << i;
    EXPECT_TRUE(unit.request.absolute_time);
    EXPECT_EQ(source.clock_time(), instant + 50 * kMs) << i;
    EXPECT_EQ(unit.pts, instant - second - 10 * kMs) << "its running time";
    EXPECT_EQ(unit.request.sequence, static_cast<uint32_t>(i));
  }
}

TEST(LfViewRequestLive, AnEagerOneDoesNotWaitForItsTurnOnceTheViewIsChanged) {
  Source source;
  source.set("framerate", 10, 1, "capture-delay", 30 * kMs, "eager", TRUE);
  source.play_live();
  // It waits until it may leave, then until its turn.
  const auto pass_wait = [&source] {
    EXPECT_TRUE(gst_harness_wait_for_clock_id_waits(source.harness(), 1, 30));
    EXPECT_TRUE(gst_harness_crank_single_clock_wait(source.harness()));
  };
  pass_wait();
  pass_wait();
  EXPECT_EQ(source.pull().pts, 0u) << "nothing has changed";
  EXPECT_EQ(source.clock_time(), 30 * kMs);
  pass_wait();
  EXPECT_EQ(source.clock_time(), 55 * kMs);
  EXPECT_TRUE(gst_harness_wait_for_clock_id_waits(source.harness(), 1, 30));
  gst_harness_set_time(source.harness(), 80 * kMs);
  source.set("yaw", 7.0);
  const Unit early = source.pull();
  EXPECT_EQ(early.pts, 50 * kMs) << "its turn would have been at 130";
  EXPECT_EQ(early.request.target_time, 0u) << "the newest that is old enough";
  // The turn is used up; the next one may leave from 155 on.
  source.set("yaw", 8.0);
  pass_wait();
  const Unit soon = source.pull();
  EXPECT_EQ(soon.pts, 125 * kMs);
  EXPECT_EQ(source.clock_time(), 155 * kMs);
  EXPECT_EQ(soon.request.target_time, 100 * kMs);
  pass_wait();
  pass_wait();
  const Unit regular = source.pull();
  EXPECT_EQ(regular.pts, 300 * kMs);
  EXPECT_EQ(source.clock_time(), 330 * kMs);
  EXPECT_EQ(regular.request.target_time, 300 * kMs);
}

TEST(LfViewRequestLive, ARigIsReadAgainWhileRunning) {
  const OtherRig first(test_rig(), [](Rig&) {});
  const OtherRig second(test_rig(), [](Rig& rig) {
    rig.cameras.pop_back();
    rig.topology = {};
    for (Camera& camera : rig.cameras) camera.width = 96;
  });
  Source source;
  source.set("rig", first.path().c_str(), "out-of-service", "11");
  source.play_live();
  EXPECT_EQ(source.next_live().request.rig_hash, first.hash());
  source.send(view_feedback_event({.view_id = 0, .out_of_service = CameraSet{5}}));
  Unit unit = source.next_live();
  unit = source.next_live();  // one may have been waiting
  EXPECT_EQ(unit.request.out_of_service, (CameraSet{1, 5}));

  source.set("rig", second.path().c_str());
  source.next_live();
  unit = source.next_live();
  EXPECT_EQ(unit.request.rig_hash, second.hash());
  EXPECT_EQ(unit.request.out_of_service, CameraSet{1}) << "what was announced is of the other rig";
  EXPECT_EQ(unit.request.view.width, 96);
  EXPECT_EQ(source.pop_message(GST_MESSAGE_WARNING), "");

  // What can't be taken changes nothing.
  source.set("rig", first.path().c_str(), "out-of-service", "15");
  source.set("rig", second.path().c_str());
  EXPECT_NE(source.pop_message(GST_MESSAGE_WARNING).find("the rig stays"), std::string::npos);
  source.set("rig", "/nowhere/rig.json");
  EXPECT_NE(source.pop_message(GST_MESSAGE_WARNING).find("/nowhere/rig.json"), std::string::npos);
  source.next_live();
  unit = source.next_live();
  EXPECT_EQ(unit.request.rig_hash, first.hash());
  EXPECT_EQ(unit.request.out_of_service, CameraSet{5});
}

TEST(LfViewRequestLive, CamerasThatTheRigDoesNotHaveAreNotNamed) {
  Source source;
  const OtherRig rig(test_rig(), [](Rig&) {});
  source.set("rig", rig.path().c_str());
  source.play_live();
  source.next_live();
  source.send(view_feedback_event({.view_id = 0, .out_of_service = CameraSet{5, 900}}));
  source.next_live();
  EXPECT_EQ(source.next_live().request.out_of_service, CameraSet{5});
}

TEST(LfViewRequestLive, InstantsThatPassedAreLeftOut) {
  Source source;
  source.set("framerate", 10, 1, "capture-delay", 30 * kMs);
  source.play_live();
  EXPECT_EQ(source.next_live().request.target_time, 0u);
  // The clock jumps over five requests: the one that waits leaves, the next is the newest.
  EXPECT_TRUE(gst_harness_wait_for_clock_id_waits(source.harness(), 1, 30));
  gst_harness_set_time(source.harness(), 655 * kMs);
  EXPECT_EQ(source.next_live().request.target_time, 100 * kMs);
  const Unit newest = source.next_live();
  EXPECT_EQ(newest.request.target_time, 600 * kMs);
  EXPECT_EQ(newest.request.sequence, 2u);
  EXPECT_EQ(newest.pts, 600 * kMs);
  EXPECT_EQ(source.next_live().request.target_time, 700 * kMs);
}

TEST(LfViewRequestLive, TheCaptureDelayIsLatency) {
  Source source;
  source.set("framerate", 20, 1, "capture-delay", 200 * kMs);
  source.play_live();
  GstQuery* query = gst_query_new_latency();
  ASSERT_TRUE(gst_pad_peer_query(source.harness()->sinkpad, query));
  gboolean live;
  GstClockTime min, max;
  gst_query_parse_latency(query, &live, &min, &max);
  gst_query_unref(query);
  EXPECT_TRUE(live);
  EXPECT_EQ(min, 200 * kMs);
  EXPECT_EQ(max, 250 * kMs);
}

GstClockTime latency_of(Source& source) {
  GstQuery* query = gst_query_new_latency();
  EXPECT_TRUE(gst_pad_peer_query(source.harness()->sinkpad, query));
  GstClockTime min = 0;
  gst_query_parse_latency(query, nullptr, &min, nullptr);
  gst_query_unref(query);
  return min;
}

TEST(LfViewRequestLive, LeftToItselfTheCaptureDelayIsWhatNodesNeed) {
  Source source;
  source.set("framerate", 10, 1);
  source.play_live();
  EXPECT_EQ(latency_of(source), 0u);
  EXPECT_EQ(source.next_live().request.target_time, 0u);
  EXPECT_TRUE(source.send(capture_delay_event(70 * kMs)));
  EXPECT_TRUE(source.send(capture_delay_event(250 * kMs))) << "another node";
  EXPECT_TRUE(source.has_message(GST_MESSAGE_LATENCY));
  const GstClockTime delay = latency_of(source);
  EXPECT_GE(delay, 250 * kMs);
  EXPECT_LE(delay, 260 * kMs);
  EXPECT_TRUE(source.send(capture_delay_event(249 * kMs)));
  EXPECT_FALSE(source.has_message(GST_MESSAGE_LATENCY)) << "that is enough for it";
  source.next_live();  // may have been waiting
  for (int i = 0; i < 3; i++) {
    const Unit unit = source.next_live();
    EXPECT_EQ(unit.pts, unit.request.target_time);
    EXPECT_EQ(source.clock_time(), unit.pts + delay);
  }
}

TEST(LfViewRequestLive, ACaptureDelayThatIsSetStays) {
  Source source;
  source.set("framerate", 10, 1, "capture-delay", 30 * kMs);
  source.play_live();
  EXPECT_TRUE(source.send(capture_delay_event(250 * kMs)));
  EXPECT_FALSE(source.has_message(GST_MESSAGE_LATENCY));
  EXPECT_EQ(latency_of(source), 30 * kMs);
}

TEST(AutoCaptureDelay, GrowsAtOnceAndShrinksLater) {
  AutoCaptureDelay delay;
  GstClockTime now = GST_SECOND;
  EXPECT_TRUE(delay.take(100 * kMs, now));
  const GstClockTime grown = delay.delay();
  EXPECT_GE(grown, 100 * kMs);
  for (int i = 0; i < 9; i++) EXPECT_FALSE(delay.take(20 * kMs, now += GST_SECOND)) << i;
  EXPECT_EQ(delay.delay(), grown);
  bool shrunk = false;
  for (int i = 0; i < 3; i++) shrunk |= delay.take(20 * kMs, now += GST_SECOND);
  EXPECT_TRUE(shrunk);
  EXPECT_LE(delay.delay(), 25 * kMs);
  EXPECT_TRUE(delay.take(GST_SECOND * 30, now)) << "not more than frames are kept for";
  EXPECT_EQ(delay.delay(), AutoCaptureDelay::kMost);
  delay.clear();
  EXPECT_EQ(delay.delay(), 0u);
}

TEST(LfViewRequestLive, EosAndStopNeverWaitForTheClock) {
  for (const bool eos : {true, false}) {
    Source source;
    source.set("framerate", 1, 3600);  // an hour to the next request
    source.play_live();
    source.next_live();
    EXPECT_TRUE(gst_harness_wait_for_clock_id_waits(source.harness(), 1, 30));
    const gint64 begin = g_get_monotonic_time();
    if (eos) {
      EXPECT_TRUE(gst_element_send_event(source.element(), gst_event_new_eos()));
      EXPECT_TRUE(source.wait_eos());
    } else {
      EXPECT_EQ(gst_element_set_state(source.element(), GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
    }
    EXPECT_LT(g_get_monotonic_time() - begin, 5'000'000);
  }
}

// A pipeline on the system clock that notes the stamps that reach its "sink".
class Pipeline {
 public:
  explicit Pipeline(const std::string& line) : pipeline_(launch(line)) {
    GstElement* sink = gst_bin_get_by_name(GST_BIN(pipeline_.get()), "sink");
    GstPad* pad = gst_element_get_static_pad(sink, "sink");
    gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_BUFFER, note, this, nullptr);
    gst_object_unref(pad);
    gst_object_unref(sink);
  }
  ~Pipeline() {
    gst_element_set_state(pipeline_.get(), GST_STATE_NULL);
    g_mutex_clear(&mutex_);
    g_cond_clear(&cond_);
  }
  GstStateChangeReturn set_state(GstState state) { return gst_element_set_state(pipeline_.get(), state); }
  // The stamps of all buffers once there are `count` of them.
  std::vector<GstClockTime> wait(size_t count) {
    g_mutex_lock(&mutex_);
    const gint64 deadline = g_get_monotonic_time() + 30 * G_TIME_SPAN_SECOND;
    while (stamps_.size() < count && g_cond_wait_until(&cond_, &mutex_, deadline)) {
    }
    const std::vector<GstClockTime> stamps = stamps_;
    g_mutex_unlock(&mutex_);
    EXPECT_GE(stamps.size(), count);
    return stamps;
  }

 private:
  static GstPadProbeReturn note(GstPad*, GstPadProbeInfo* info, gpointer data) {
    auto* self = static_cast<Pipeline*>(data);
    g_mutex_lock(&self->mutex_);
    self->stamps_.push_back(GST_BUFFER_PTS(GST_PAD_PROBE_INFO_BUFFER(info)));
    g_cond_signal(&self->cond_);
    g_mutex_unlock(&self->mutex_);
    return GST_PAD_PROBE_OK;
  }

  ElementPtr pipeline_;
  GMutex mutex_{};
  GCond cond_{};
  std::vector<GstClockTime> stamps_;
};

TEST(LfViewRequestStates, PausesAndGoesOn) {
  Pipeline pipeline("lfviewrequest is-live=true framerate=100/1 ! fakesink name=sink sync=false");
  EXPECT_EQ(pipeline.set_state(GST_STATE_PAUSED), GST_STATE_CHANGE_NO_PREROLL);
  size_t count = 0;
  for (int i = 0; i < 5; i++) {
    EXPECT_NE(pipeline.set_state(GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
    count = pipeline.wait(count + 3).size();
    EXPECT_EQ(pipeline.set_state(GST_STATE_PAUSED), GST_STATE_CHANGE_NO_PREROLL);
  }
  const std::vector<GstClockTime> stamps = pipeline.wait(15);
  for (size_t i = 1; i < stamps.size(); i++) EXPECT_GT(stamps[i], stamps[i - 1]) << i;
}

TEST(LfViewRequestStates, StartsAndStopsTwoHundredTimes) {
  const gint64 begin = g_get_monotonic_time();
  for (const char* live : {"true", "false"}) {
    Pipeline pipeline(std::string("lfviewrequest is-live=") + live +
                      " framerate=1000/1 ! fakesink name=sink sync=true");
    for (int i = 0; i < 100; i++) {
      EXPECT_NE(pipeline.set_state(GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
      if (i % 10 == 0) pipeline.wait(i / 10 + 1);
      EXPECT_EQ(pipeline.set_state(GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
    }
  }
  RecordProperty("ms_per_cycle", std::to_string((g_get_monotonic_time() - begin) / 200e3));
}

TEST(LfViewRequestStates, SequencesAndTimesStartAnew) {
  const TemporaryFiles files;
  save_views(test_views({0, 0}), files.path("views.json"));
  Source source;
  source.set("location", files.path("views.json").c_str());
  source.play();
  for (int run = 0; run < 2; run++) {
    for (uint32_t i = 0; i < 2; i++) {
      const Unit unit = source.pull();
      EXPECT_EQ(unit.request.sequence, i);
      EXPECT_EQ(unit.request.view.width, 32 + static_cast<int>(i));
    }
    EXPECT_TRUE(source.wait_eos());
    if (run > 0) break;
    EXPECT_EQ(gst_element_set_state(source.element(), GST_STATE_READY), GST_STATE_CHANGE_SUCCESS);
    EXPECT_NE(gst_element_set_state(source.element(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  }
}

}  // namespace
}  // namespace lf::test
