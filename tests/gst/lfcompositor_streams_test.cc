// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Irregular input streams of lfcompositor: other views, missing timestamps, ends at different times.

#include "gst/compositor_fixture.h"

namespace lf::test {
namespace {

class LfCompositorStreamsTest : public LfCompositorTest {
 protected:
  ~LfCompositorStreamsTest() override {
    if (element_) gst_element_set_state(element_.get(), GST_STATE_NULL);
    if (pusher_.joinable()) pusher_.join();
  }
  // Pushes in a separate thread, because the push may block.
  void push_many(const wire::Answer& answer, int count) {
    pusher_ = std::thread([this, bytes = wire::encode_answer(answer), count] {
      for (int i = 0; i < count; i++)
        if (gst_harness_push(nodes_[0].get(), to_buffer(bytes)) == GST_FLOW_OK) pushed_++;
    });
  }
  std::atomic<int> pushed_ = 0;

 private:
  std::thread pusher_;
};

TEST_F(LfCompositorStreamsTest, AnswersToOtherViewsDoNotBlock) {
  start(1);
  push_many(answer_of(array_.request(0, 0, 7), {0}), 500);
  EXPECT_TRUE(eventually([&] { return pushed_ == 500; })) << "stopped taking answers after " << pushed_;
}

TEST_F(LfCompositorStreamsTest, RequestsOfOtherViewsDoNotBlock) {
  start(1);
  std::atomic<int> taken = 0;
  std::thread requests([&] {
    for (uint32_t i = 0; i < 500; i++) {
      GstBuffer* buffer = to_buffer(wire::encode_request(array_.request(i, i * kFrame, 7)));
      GST_BUFFER_PTS(buffer) = i * kFrame;
      taken += gst_harness_push(harness_.get(), buffer) == GST_FLOW_OK;
    }
  });
  EXPECT_TRUE(eventually([&] { return taken == 500; })) << "stopped taking requests after " << taken;
  gst_element_set_state(element_.get(), GST_STATE_NULL);
  requests.join();
}

TEST_F(LfCompositorStreamsTest, AnswersWithoutTimestampsAreBounded) {
  start(1);
  push_many(answer_of(array_.request(0, 0), {0}), 1000);
  int before = -1;
  EXPECT_TRUE(eventually([&] {
    const bool rests = pushed_ == before;
    before = pushed_;
    g_usleep(300000);
    return rests;
  }));
  EXPECT_GT(pushed_, 0);
  EXPECT_LT(pushed_, 50);
}

TEST_F(LfCompositorStreamsTest, PartialCannotChangeWhileRunning) {
  start(1, {{"rig", array_.rig_path()}});
  const ElementBus bus(element_.get());
  ask_and_answer(0, 0, {0, 1, 2, 3});
  const size_t size = pull().size();
  const std::string caps = caps_of(harness_->sinkpad);
  g_object_set(element_.get(), "partial", TRUE, nullptr);
  EXPECT_FALSE(get<gboolean>(element_.get(), "partial"));
  EXPECT_THAT(bus.warnings(), mentions("partial", "changed"));
  ask_and_answer(1, kFrame, {0, 1, 2, 3});
  EXPECT_EQ(pull().size(), size);
  EXPECT_EQ(caps_of(harness_->sinkpad), caps);
  gst_element_set_state(element_.get(), GST_STATE_READY);
  g_object_set(element_.get(), "partial", TRUE, nullptr);
  EXPECT_TRUE(get<gboolean>(element_.get(), "partial")) << "allowed in READY";
}

TEST_F(LfCompositorStreamsTest, EosOfTheRequestsEndsTheOutput) {
  start(1);
  ask_and_answer(0, 0, {0});
  pull();
  GstEvent* eos = gst_event_new_eos();
  const guint32 seqnum = gst_event_get_seqnum(eos);
  gst_harness_push_event(harness_.get(), eos);
  EventPtr event(gst_harness_pull_event(harness_.get()));
  while (event && GST_EVENT_TYPE(event.get()) != GST_EVENT_EOS) event.reset(gst_harness_pull_event(harness_.get()));
  ASSERT_TRUE(event);
  EXPECT_EQ(gst_event_get_seqnum(event.get()), seqnum);
}

TEST_F(LfCompositorStreamsTest, PausesAfterTheEnd) {
  start(1);
  ask_and_answer(0, 0, {0});
  pull();
  for (GstHarness* each : {harness_.get(), nodes_[0].get()}) gst_harness_push_event(each, gst_event_new_eos());
  EXPECT_TRUE(
      eventually([&] { return gst_pad_get_task_state(pad_of(element_.get(), "src").get()) == GST_TASK_PAUSED; }));
  int ends = 0;
  while (const EventPtr event{gst_harness_try_pull_event(harness_.get())})
    ends += GST_EVENT_TYPE(event.get()) == GST_EVENT_EOS;
  EXPECT_EQ(ends, 1);
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  const guint32 seek = gst_util_seqnum_next();
  const auto push_to_all = [&](const std::function<GstEvent*()>& event) {
    for (GstHarness* each : {harness_.get(), nodes_[0].get()}) {
      GstEvent* sent = event();
      gst_event_set_seqnum(sent, seek);
      gst_harness_push_event(each, sent);
    }
  };
  push_to_all(gst_event_new_flush_start);
  push_to_all([] { return gst_event_new_flush_stop(TRUE); });
  push_to_all([&] { return gst_event_new_segment(&segment); });
  ask_and_answer(1, kFrame, {0});
  EXPECT_FALSE(pull().empty());
}

TEST_F(LfCompositorStreamsTest, UnlinkedPadCausesAWarningAndCanBeRelinked) {
  start(1);
  const ElementBus bus(element_.get());
  const auto show = [&](uint32_t i) { ask_and_answer(i, i * kFrame, {0}); };
  show(0);
  pull();
  const PadPtr src = pad_of(element_.get(), "src");
  ASSERT_TRUE(gst_pad_unlink(src.get(), harness_->sinkpad));
  for (uint32_t i = 1; i < 4; i++) show(i);
  EXPECT_TRUE(eventually([&] { return stat(element_.get(), "pictures") == 4; }));
  ASSERT_EQ(gst_pad_link(src.get(), harness_->sinkpad), GST_PAD_LINK_OK);
  show(4);
  pull();
  EXPECT_EQ(last_pts_, 4 * kFrame);
  EXPECT_EQ(all_warnings_on(bus.get()).size(), 1u);
}

TEST_F(LfCompositorStreamsTest, PicturesAreInTheSegmentOfTheRequests) {
  start(1);
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  segment.start = segment.time = segment.position = 5 * kFrame;
  segment.stop = 8 * kFrame;
  ASSERT_TRUE(gst_harness_push_event(harness_.get(), gst_event_new_segment(&segment)));
  ask_and_answer(0, 6 * kFrame, {0});
  pull();
  EXPECT_EQ(last_pts_, 6 * kFrame);
  const EventPtr event(gst_pad_get_sticky_event(harness_->sinkpad, GST_EVENT_SEGMENT, 0));
  const GstSegment* out = nullptr;
  gst_event_parse_segment(event.get(), &out);
  EXPECT_EQ(out->start, segment.start);
  EXPECT_EQ(out->time, segment.time);
  EXPECT_EQ(out->stop, segment.stop);
}

TEST_F(LfCompositorStreamsTest, PicturesHaveCaptureTimes) {
  start(1);
  ask_and_answer(0, 3 * kFrame + 5, {0});
  const BufferPtr picture(gst_harness_pull(harness_.get()));
  ASSERT_TRUE(picture);
  const CapsPtr reference(gst_caps_from_string("timestamp/x-lightfield-capture"));
  const GstReferenceTimestampMeta* meta = gst_buffer_get_reference_timestamp_meta(picture.get(), reference.get());
  ASSERT_TRUE(meta);
  EXPECT_EQ(meta->timestamp, 3 * kFrame + 5);
}

TEST_F(LfCompositorStreamsTest, ViewWithoutRequestsIsReportedOnce) {
  start(1, {{"view-id", "3"}});
  const ElementBus bus(element_.get());
  std::vector<std::string> warnings;
  for (uint32_t i = 0; i < 160; i++) {
    request(array_.request(i, i * kFrame, 7));
    g_usleep(50000);
    for (const std::string& text : all_warnings_on(bus.get())) warnings.push_back(text);
  }
  EXPECT_THAT(warnings, ElementsAre(mentions("No client", "view 3")));
}

TEST_F(LfCompositorStreamsTest, ViewOutsideTheArrayIsCounted) {
  start(1, {{"rig", array_.rig_path()}, {"post-messages", "true"}});
  const ElementBus bus(element_.get());
  std::vector<std::string> warnings;
  const auto show = [&](uint32_t i, bool away) {
    ViewRequest asked = array_.request(i, i * kFrame);
    if (away) asked.view.pose.position.x += 1000;
    request_and_answer(asked, {0, 1, 2, 3});
    pull();
    const auto pop = [&] {
      return MessagePtr(gst_bus_pop_filtered(bus.get(), GstMessageType(GST_MESSAGE_ELEMENT | GST_MESSAGE_WARNING)));
    };
    MessagePtr message = pop();
    for (; message && GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_WARNING; message = pop())
      warnings.push_back(text_of(message.get()));
    EXPECT_TRUE(message);
    gboolean complete = -1;
    double coverage = -1;
    gst_structure_get(gst_message_get_structure(message.get()), "complete", G_TYPE_BOOLEAN, &complete, "coverage",
                      G_TYPE_DOUBLE, &coverage, nullptr);
    return std::pair(complete != FALSE, coverage);
  };
  const auto [complete, coverage] = show(0, false);
  EXPECT_TRUE(complete);
  EXPECT_GT(coverage, 0.9);
  for (uint32_t i = 1; i < 4; i++) EXPECT_EQ(show(i, true), std::pair(false, 0.0));
  EXPECT_EQ(stat(element_.get(), "complete"), 1u);
  EXPECT_EQ(stat(element_.get(), "unseen"), 3u);
  EXPECT_THAT(warnings, ElementsAre(mentions("No camera", "view 0")));
  EXPECT_EQ(stat(element_.get(), "missing-fragments"), 0u);
}

// Data queued on the restarted node's pad is dropped; the pads of other nodes are undisturbed.
TEST_F(LfCompositorStreamsTest, FlushAffectsOneNode) {
  start(2, {{"rig", array_.rig_path()}});
  for (uint32_t i = 0; i < 20; i++) {
    const ViewRequest asked = array_.request(i, i * kFrame);
    request(asked);
    const size_t flushed = i % 2;
    push(flushed, answer_of(asked, {0, 1}, 7));
    flush(nodes_[flushed].get());
    push(flushed, answer_of(asked, {0, 1}));
    push(1 - flushed, answer_of(asked, {2, 3}));
    EXPECT_GE(range(pull()).first, 199) << i;
  }
  EXPECT_EQ(stat(element_.get(), "complete"), 20u);
}

TEST_F(LfCompositorStreamsTest, RestartUsesTheLatestRig) {
  const ModifiedRig other(array_.rig(), [](Rig& rig) { rig.cameras[0].pose.position.x += 1e-3; });
  start(1, {{"rig", array_.rig_path()}});
  ViewRequest asked = ask_and_answer(0, 0, {0, 1, 2, 3});
  pull();
  g_object_set(element_.get(), "rig", other.path().c_str(), nullptr);
  gst_element_set_state(element_.get(), GST_STATE_READY);
  g_object_set(element_.get(), "rig", array_.rig_path().c_str(), nullptr);
  gst_element_set_state(element_.get(), GST_STATE_PLAYING);
  for (GstHarness* harness : {harness_.get(), nodes_[0].get()}) {
    gst_pad_set_active(harness->srcpad, TRUE);
    gst_harness_set_src_caps_str(harness, harness == harness_.get() ? "application/x-lightfield-request,framerate=10/1"
                                                                    : "application/x-lightfield-answer");
  }
  asked = array_.request(1, 0);
  asked.rig_hash = 0;  // the compositor's rig applies
  request_and_answer(asked, {0, 1, 2, 3});
  EXPECT_GE(range(pull()).first, 199);
  EXPECT_EQ(stat(element_.get(), "rig-mismatches"), 0u);
}

}  // namespace
}  // namespace lf::test
