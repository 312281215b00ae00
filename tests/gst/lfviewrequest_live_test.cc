// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/custom_events.h"
#include "gst/array_fixture.h"
#include "gst/view_request_source.h"
#include "node/camera_access.h"
#include "wire/command_codec.h"

namespace lf::test {
namespace {

TEST(LfViewRequestLive, RequestsFollowTheCaptureSchedule) {
  Source source;
  source.set("framerate", 15, 1, "capture-delay", 50 * kMs);
  const GstClockTime second = 1'700'000'000ull * GST_SECOND;  // a realtime clock's reading
  gst_element_set_base_time(source.element(), second + 10 * kMs);
  source.play_live(second + 10 * kMs);
  for (int i = 0; i < 40; i++) {
    const Unit unit = source.next_live();
    // The first capture instants after the start; each is requested 50 ms later.
    const GstClockTime instant = second + gst_util_uint64_scale(i + 1, GST_SECOND, 15);
    EXPECT_EQ(unit.request.target_time, instant) << i;
    EXPECT_TRUE(unit.request.absolute_time);
    EXPECT_EQ(source.clock_time(), instant + 50 * kMs) << i;
    EXPECT_EQ(unit.pts, instant - second - 10 * kMs) << "running time of the request";
    EXPECT_EQ(unit.request.sequence, static_cast<uint32_t>(i));
  }
}

// Otherwise a slow machine, where many requests are dropped, would hardly ever test depths.
TEST(LfViewRequestLive, SkippedRequestsLoseNothing) {
  Source source;
  source.set("framerate", 10, 1, "capture-delay", 30 * kMs);
  static std::vector<guint64> asked;
  asked.clear();
  const auto skips = +[](GstElement*, guint64 time, gpointer) -> gboolean {
    asked.push_back(time);
    return time % (400 * kMs) != 0;
  };
  g_signal_connect(source.element(), "skip-request", G_CALLBACK(skips), nullptr);
  ViewRequest request;
  request.view = make_view(Viewpoint{}, 64, 48);
  FocalMap map = FocalMap::for_view(64, 48);
  map.from = {{0, 0, -1}, 0};
  map.nearest = 1;
  map.levels.resize(static_cast<size_t>(map.columns) * map.rows);
  DepthEstimate estimate;
  estimate.plan.view = request.view;
  estimate.plan.view.focus.map = std::make_shared<const FocalMap>(map);
  estimate.plan.hypotheses = {{DepthHypothesis::Kind::kPlane, 9}};
  source.play_live();
  EXPECT_EQ(source.next_live().pts, 0u);
  EXPECT_TRUE(source.send(view_feedback_event({.view_id = 0, .focus = estimate})));
  for (int i = 0; i < 3; i++) source.pass_wait();
  const Unit next = source.next_live();
  EXPECT_EQ(next.pts, 400 * kMs);
  EXPECT_EQ(next.request.sequence, 1u);
  EXPECT_EQ(next.request.hypotheses, estimate.plan.hypotheses);
  EXPECT_THAT(asked, testing::ElementsAre(0, 100 * kMs, 200 * kMs, 300 * kMs, 400 * kMs));
}

TEST(LfViewRequestLive, EagerRequestsFollowChangesOfTheView) {
  Source source;
  source.set("framerate", 10, 1, "capture-delay", 30 * kMs, "eager", TRUE);
  source.play_live();
  // First the wait until a request may leave, then the wait for the next scheduled request.
  source.pass_wait();
  source.pass_wait();
  EXPECT_EQ(source.pull().pts, 0u) << "unchanged";
  EXPECT_EQ(source.clock_time(), 30 * kMs);
  source.pass_wait();
  EXPECT_EQ(source.clock_time(), 55 * kMs);
  EXPECT_TRUE(gst_harness_wait_for_clock_id_waits(source.harness(), 1, 30));
  gst_harness_set_time(source.harness(), 80 * kMs);
  source.set("yaw", 7.0);
  const Unit early = source.pull();
  EXPECT_EQ(early.pts, 50 * kMs) << "scheduled for 130";
  EXPECT_EQ(early.request.target_time, 0u) << "newest time that is old enough";
  // This request replaces the scheduled one; the next may leave at 155.
  source.set("yaw", 8.0);
  source.pass_wait();
  const Unit soon = source.pull();
  EXPECT_EQ(soon.pts, 125 * kMs);
  EXPECT_EQ(source.clock_time(), 155 * kMs);
  EXPECT_EQ(soon.request.target_time, 100 * kMs);
  source.pass_wait();
  source.pass_wait();
  const Unit regular = source.pull();
  EXPECT_EQ(regular.pts, 300 * kMs);
  EXPECT_EQ(source.clock_time(), 330 * kMs);
  EXPECT_EQ(regular.request.target_time, 300 * kMs);
}

TEST(LfViewRequestLive, RigIsReloadedWhileRunning) {
  const ModifiedRig first(test_rig(), [](Rig&) {});
  const ModifiedRig second(test_rig(), [](Rig& rig) {
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
  unit = source.next_live();
  EXPECT_EQ(unit.request.out_of_service, (CameraSet{1, 5}));

  source.set("rig", second.path().c_str());
  source.next_live();
  unit = source.next_live();
  EXPECT_EQ(unit.request.rig_hash, second.hash());
  EXPECT_EQ(unit.request.out_of_service, CameraSet{1}) << "announced for the other rig";
  EXPECT_EQ(unit.request.view.width, 96);
  EXPECT_EQ(source.pop_message(GST_MESSAGE_WARNING), "");

  source.set("rig", first.path().c_str(), "out-of-service", "15");
  source.set("rig", second.path().c_str());
  EXPECT_MENTIONS(source.pop_message(GST_MESSAGE_WARNING), "rig stays");
  source.set("rig", "/nowhere/rig.json");
  EXPECT_THAT(source.pop_message(GST_MESSAGE_WARNING), HasSubstr("/nowhere/rig.json"));
  source.next_live();
  unit = source.next_live();
  EXPECT_EQ(unit.request.rig_hash, first.hash());
  EXPECT_EQ(unit.request.out_of_service, CameraSet{5});
}

TEST(LfViewRequestLive, CamerasMissingInTheRigAreNotNamed) {
  Source source;
  const ModifiedRig rig(test_rig(), [](Rig&) {});
  source.set("rig", rig.path().c_str());
  source.play_live();
  source.next_live();
  source.send(view_feedback_event({.view_id = 0, .out_of_service = CameraSet{5, 900}}));
  source.next_live();
  EXPECT_EQ(source.next_live().request.out_of_service, CameraSet{5});
}

TEST(LfViewRequestLive, MissedInstantsAreSkipped) {
  Source source;
  source.set("framerate", 10, 1, "capture-delay", 30 * kMs);
  source.play_live();
  EXPECT_EQ(source.next_live().request.target_time, 0u);
  // The clock skips five requests: the waiting one leaves, the next one is the newest.
  EXPECT_TRUE(gst_harness_wait_for_clock_id_waits(source.harness(), 1, 30));
  gst_harness_set_time(source.harness(), 655 * kMs);
  EXPECT_EQ(source.next_live().request.target_time, 100 * kMs);
  const Unit newest = source.next_live();
  EXPECT_EQ(newest.request.target_time, 600 * kMs);
  EXPECT_EQ(newest.request.sequence, 2u);
  EXPECT_EQ(newest.pts, 600 * kMs);
  EXPECT_EQ(source.next_live().request.target_time, 700 * kMs);
}

// Returns the minimum and maximum latency of a live source.
std::pair<GstClockTime, GstClockTime> latencies_of(GstHarness* harness) {
  g_autoptr(GstQuery) query = gst_query_new_latency();
  EXPECT_TRUE(gst_pad_peer_query(harness->sinkpad, query));
  gboolean live = FALSE;
  std::pair<GstClockTime, GstClockTime> latencies;
  gst_query_parse_latency(query, &live, &latencies.first, &latencies.second);
  EXPECT_TRUE(live);
  return latencies;
}

GstClockTime latency_of(Source& source) { return latencies_of(source.harness()).first; }

TEST(LfViewRequestLive, CaptureDelayIsLatency) {
  Source source;
  source.set("framerate", 20, 1, "capture-delay", 200 * kMs);
  source.play_live();
  EXPECT_EQ(latencies_of(source.harness()), std::pair(200 * kMs, 250 * kMs));
}

TEST(LfViewRequestLive, AutomaticCaptureDelayFollowsTheNodes) {
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
  EXPECT_FALSE(source.has_message(GST_MESSAGE_LATENCY)) << "the latency already covers the delay";
  source.next_live();
  for (int i = 0; i < 3; i++) {
    const Unit unit = source.next_live();
    EXPECT_EQ(unit.pts, unit.request.target_time);
    EXPECT_EQ(source.clock_time(), unit.pts + delay);
  }
}

TEST(LfViewRequestLive, ExplicitCaptureDelayStays) {
  Source source;
  source.set("framerate", 10, 1, "capture-delay", 30 * kMs);
  source.play_live();
  EXPECT_TRUE(source.send(capture_delay_event(250 * kMs)));
  EXPECT_FALSE(source.has_message(GST_MESSAGE_LATENCY));
  EXPECT_EQ(latency_of(source), 30 * kMs);
}

TEST(AutoCaptureDelay, GrowsAtOnceAndShrinksSlowly) {
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
  EXPECT_TRUE(delay.take(GST_SECOND * 30, now)) << "limited by the frame history";
  EXPECT_EQ(delay.delay(), AutoCaptureDelay::kMost);
  delay.clear();
  EXPECT_EQ(delay.delay(), 0u);
}

TEST(LfViewRequestLive, EosAndStopNeverWaitForTheClock) {
  for (const bool eos : {true, false}) {
    Source source;
    source.set("framerate", 1, 3600);
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

class Pipeline {
 public:
  explicit Pipeline(const std::string& line) : pipeline_(launch(line)) {
    on_buffers(child_of(pipeline_.get(), "sink").get(), "sink", [this](GstBuffer* buffer) {
      const std::lock_guard lock(mutex_);
      stamps_.push_back(GST_BUFFER_PTS(buffer));
      more_.notify_one();
    });
  }
  ~Pipeline() { pipeline_.reset(); }
  GstStateChangeReturn set_state(GstState state) { return gst_element_set_state(pipeline_.get(), state); }
  std::vector<GstClockTime> wait(size_t count) {
    std::unique_lock lock(mutex_);
    EXPECT_TRUE(more_.wait_for(lock, std::chrono::seconds(30), [&] { return stamps_.size() >= count; }));
    return stamps_;
  }

 private:
  PipelinePtr pipeline_;
  std::mutex mutex_;
  std::condition_variable more_;
  std::vector<GstClockTime> stamps_;
};

TEST(LfViewRequestStates, PausesAndResumes) {
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

TEST(LfViewRequestStates, SequencesAndTimesRestart) {
  FileSource source(test_views({0, 0}));
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

class LfViewRequestRelay : public testing::Test {
 protected:
  void start(bool live = false) {
    element_ = make_element("lfviewrequest");
    g_object_set(element_.get(), "is-live", live, nullptr);
    harness_.reset(gst_harness_new_with_element(element_.get(), "sink", "src"));
    gst_harness_set_src_caps_str(harness_.get(), "application/x-lightfield-request,framerate=30/1");
  }

  ViewRequest request(uint32_t view_id, uint32_t sequence, const CameraSet& out = {}) {
    ViewRequest request;
    request.view_id = view_id;
    request.sequence = sequence;
    request.view = test_views({0})[0].view;
    request.out_of_service = out;
    return request;
  }

  void push(const ViewRequest& request, GstClockTime pts = 0) {
    GstBuffer* buffer = to_buffer(wire::encode_request(request));
    GST_BUFFER_PTS(buffer) = pts;
    ASSERT_EQ(gst_harness_push(harness_.get(), buffer), GST_FLOW_OK);
  }

  ViewRequest pull() {
    const BufferPtr buffer(gst_harness_pull(harness_.get()));
    EXPECT_TRUE(buffer);
    if (!buffer) return {};
    pts_ = GST_BUFFER_PTS(buffer.get());
    return wire::decode_request(to_bytes(buffer.get())).value_or(ViewRequest{});
  }

  void announce(guint view_id, const CameraSet& cameras) {
    EXPECT_TRUE(gst_harness_push_upstream_event(harness_.get(),
                                                view_feedback_event({.view_id = view_id, .out_of_service = cameras})));
  }

  ElementPtr element_;
  HarnessPtr harness_;
  GstClockTime pts_ = 0;
};

TEST_F(LfViewRequestRelay, ForwardsRequestsUnchanged) {
  start();
  for (uint32_t i = 0; i < 5; i++) {
    const ViewRequest asked = request(i % 2, i, {3});
    push(asked, i * kMs);
    EXPECT_EQ(pull(), asked);
    EXPECT_EQ(pts_, i * kMs);
  }
  const CapsPtr caps(gst_pad_get_current_caps(harness_->sinkpad));
  EXPECT_TRUE(gst_structure_has_field(gst_caps_get_structure(caps.get(), 0), "framerate"));
  gst_harness_push_event(harness_.get(), gst_event_new_eos());
  EXPECT_TRUE(reaches_eos(harness_.get()));
}

TEST_F(LfViewRequestRelay, AddsCamerasOutOfServiceOfTheView) {
  start();
  announce(1, {5, 9});
  push(request(1, 0, {3, 9}));
  EXPECT_EQ(pull().out_of_service, (CameraSet{3, 5, 9}));
  push(request(2, 0, {3, 9}));
  EXPECT_EQ(pull().out_of_service, (CameraSet{3, 9}));
  announce(1, {});
  push(request(1, 1));
  EXPECT_TRUE(pull().out_of_service.empty());
}

TEST_F(LfViewRequestRelay, ReportsTheLatencyOfRelayedRequests) {
  for (const bool upstream_is_live : {true, false}) {
    start(true);
    gst_harness_set_live(harness_.get(), upstream_is_live);
    gst_harness_set_upstream_latency(harness_.get(), 200 * kMs);
    EXPECT_EQ(latencies_of(harness_.get()).first, upstream_is_live ? 200 * kMs : 0);
  }
}

// The viewer does not know which cameras are out of service here: the relay removes the viewer's commands and creates
// new ones.
TEST_F(LfViewRequestRelay, ReplacesCommands) {
  TempDir files;
  const Rig rig = test_rig();
  save_rig(rig, files / "rig.json");
  start();
  gst_element_set_state(element_.get(), GST_STATE_READY);
  g_object_set(element_.get(), "rig", (files / "rig.json").c_str(), nullptr);
  gst_util_set_object_arg(G_OBJECT(element_.get()), "access", "pixels");
  gst_element_set_state(element_.get(), GST_STATE_PLAYING);
  announce(1, {5});
  ViewRequest asked = request(1, 0);
  asked.view = make_view(default_viewpoint(rig), 32, 24);
  push(asked);
  const auto of_viewer =
      wire::encode_any_request(CameraAccess::of(Access::kWarp)->command(rig, build_mesh(rig), asked));
  ASSERT_EQ(gst_harness_push(harness_.get(), to_buffer(of_viewer)), GST_FLOW_OK);
  asked.out_of_service = {5};
  EXPECT_EQ(pull(), asked);
  const BufferPtr command(gst_harness_pull(harness_.get()));
  ASSERT_TRUE(command);
  EXPECT_EQ(wire::decode_any_request(to_bytes(command.get())),
            CameraAccess::of(Access::kPixels)->command(rig, build_mesh(rig, {5}), asked));
  asked.sequence++;
  push(asked);
  EXPECT_EQ(pull(), asked) << "the viewer's command is over";
}

// A viewer behind a network receives no feedback from compositors: the relay adds the focal surface to its requests.
// Requests stay unchanged if an upstream element handles the surface, or if they come from a file.
TEST_F(LfViewRequestRelay, AddsFocalSurfacesThatNoViewerAccepts) {
  const struct {
    bool live, taken, changes;
  } cases[] = {{true, false, true}, {true, true, false}, {false, false, false}};
  for (const auto& [live, taken, changes] : cases) {
    start(live);
    if (!taken)
      gst_pad_set_event_function(
          harness_->srcpad, +[](GstPad*, GstObject*, GstEvent* event) -> gboolean {
            gst_event_unref(event);
            return FALSE;
          });
    ViewRequest asked = request(1, 0);
    push(asked);
    EXPECT_EQ(pull(), asked);
    DepthEstimator::Plan plan{asked.view, {{DepthHypothesis::Kind::kPlane, 200}}};
    plan.view.focus.map = flat_surface(asked.view);
    const ViewFeedback feedback{.view_id = asked.view_id, .focus = DepthEstimate{asked.sequence, plan, asked.gains}};
    EXPECT_EQ(gst_harness_push_upstream_event(harness_.get(), view_feedback_event(feedback)), live);

    ViewRequest other = asked;
    other.view_id = 2;
    push(other);
    EXPECT_EQ(pull(), other) << "for another view";
    for (uint32_t i = 1; i < 3; i++) {
      asked.sequence = i;
      push(asked);
      const ViewRequest sent = pull();
      EXPECT_EQ(sent.view.focus.map != nullptr, changes);
      EXPECT_EQ(sent.hypotheses.size(), changes && i == 1 ? 1u : 0u) << "hypotheses are sent once";
    }
  }
}

TEST_F(LfViewRequestRelay, DropsGarbage) {
  start();
  ASSERT_EQ(gst_harness_push(harness_.get(), to_buffer({1, 2, 3})), GST_FLOW_OK);
  push(request(0, 7));
  EXPECT_EQ(pull().sequence, 7u);
}

TEST_F(LfViewRequestRelay, FlushesAndStopsWaitingThreads) {
  for (const bool live : {false, true}) {
    for (int i = 0; i < 20; i++) {
      start(live);
      if (i % 2) push(request(0, 0));
      if (i % 3 == 0) {
        gst_harness_push_event(harness_.get(), gst_event_new_flush_start());
        gst_harness_push_event(harness_.get(), gst_event_new_flush_stop(TRUE));
      }
      harness_.reset();
    }
  }
}

TEST(LfViewRequestOutOfService, AnnouncedCamerasAreInTheNextRequests) {
  RigSource source;
  source.set("out-of-service", "11", "view-id", 4u);
  source.play_live();
  EXPECT_EQ(source.next_live().request.out_of_service, CameraSet{1});
  const auto announce = [&](guint view_id, const CameraSet& cameras) {
    EXPECT_TRUE(source.send(view_feedback_event({.view_id = view_id, .out_of_service = cameras})));
  };
  announce(4, {0, 3});
  announce(5, {2});
  EXPECT_EQ(source.next_live().request.out_of_service, (CameraSet{0, 1, 3}));
  announce(4, {});
  EXPECT_EQ(source.next_live().request.out_of_service, CameraSet{1});
}

}  // namespace
}  // namespace lf::test
