// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Who shows pictures says that they come too late: requests that can't be in time are left out first.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "gst/compositor_fixture.h"

namespace lf::test {
namespace {

GstEvent* late_by(GstClockTimeDiff diff, GstClockTime timestamp) {
  return gst_event_new_qos(GST_QOS_TYPE_UNDERFLOW, 2, diff, timestamp);
}

GstEvent* for_view(GstEvent* event, guint view_id) {
  gst_structure_set(gst_event_writable_structure(event), "lightfield-view-id", G_TYPE_UINT, view_id, nullptr);
  return event;
}

class LfCompositorQosTest : public LfCompositorTest {
 protected:
  void start_two_frames_late(GstClockTime timestamp) {
    start(1, {{"view-id", "3"}});
    bus_.reset(gst_bus_new());
    gst_element_set_bus(element_.get(), bus_.get());
    gst_harness_query_latency(harness_.get());  // the harness was live at first
    tell(late_by(2 * kFrame, timestamp));
  }
  void tell(GstEvent* event) { gst_harness_push_upstream_event(harness_.get(), event); }
  // Asked for and answered.
  void one(uint32_t sequence) {
    const ViewRequest asked = array_.request(sequence, sequence * kFrame, 3);
    request(asked);
    push(0, answer_of(asked, {0, 1, 2, 3}));
  }
  std::unique_ptr<GstBus, Unref<gst_object_unref>> bus_;
};

TEST_F(LfCompositorQosTest, WhatCantBeInTimeIsLeftOutAndSaidSo) {
  start_two_frames_late(kFrame);  // not live: four frames until it is made up for
  for (uint32_t i = 2; i <= 5; i++) one(i);
  pull();
  EXPECT_EQ(last_pts_, 5 * kFrame);
  EXPECT_EQ(stat(element_.get(), "skipped"), 3u);
  EXPECT_EQ(stat(element_.get(), "pictures"), 1u);
  EXPECT_EQ(stat(element_.get(), "incomplete"), 0u);
  EXPECT_EQ(stat(element_.get(), "late-answers"), 0u);
  for (uint64_t i = 2; i < 5; i++) {
    GstMessage* message = gst_bus_pop_filtered(bus_.get(), GST_MESSAGE_QOS);
    ASSERT_TRUE(message);
    gboolean live = TRUE;
    guint64 running = 0, stream = 0, pts = 0, duration = 0, processed = 0, dropped = 0;
    gint64 jitter = 0;
    gdouble proportion = 0;
    GstFormat format{};
    gst_message_parse_qos(message, &live, &running, &stream, &pts, &duration);
    gst_message_parse_qos_values(message, &jitter, &proportion, nullptr);
    gst_message_parse_qos_stats(message, &format, &processed, &dropped);
    gst_message_unref(message);
    EXPECT_FALSE(live);
    EXPECT_EQ(running, i * kFrame);
    EXPECT_EQ(pts, i * kFrame);
    EXPECT_EQ(duration, kFrame);
    EXPECT_EQ(jitter, static_cast<gint64>((5 - i) * kFrame));
    EXPECT_EQ(proportion, 2);
    EXPECT_EQ(format, GST_FORMAT_BUFFERS);
    EXPECT_EQ(processed, 0u);
    EXPECT_EQ(dropped, i - 1);
  }
}

// The nodes may have left it out already: nothing is shown of it.
TEST_F(LfCompositorQosTest, TheRequestThatIsBeingAnsweredIsLeftOutToo) {
  start(2, {{"view-id", "3"}});
  const ViewRequest first = array_.request(1, kFrame, 3), second = array_.request(3, 3 * kFrame, 3);
  request(first);
  push(0, answer_of(first, {0, 1}));
  tell(late_by(kFrame, kFrame));
  push(1, answer_of(first, {}));
  request(second);
  push(0, answer_of(second, {0, 1}));
  push(1, answer_of(second, {2, 3}));
  pull();
  EXPECT_EQ(last_pts_, 3 * kFrame);
  EXPECT_EQ(stat(element_.get(), "skipped"), 1u);
  EXPECT_EQ(stat(element_.get(), "incomplete"), 0u);
}

TEST_F(LfCompositorQosTest, NodesHearOfWhichView) {
  start(1, {{"view-id", "3"}});
  one(0);  // GstAggregator tells pads that have buffers
  pull();
  tell(late_by(kFrame, 0));
  std::optional<guint> view_id;
  while (GstEvent* event = gst_harness_try_pull_upstream_event(nodes_[0].get())) {
    guint of = 0;
    if (GST_EVENT_TYPE(event) == GST_EVENT_QOS &&
        gst_structure_get_uint(gst_event_get_structure(event), "lightfield-view-id", &of))
      view_id = of;
    gst_event_unref(event);
  }
  EXPECT_EQ(view_id, 3u);
}

TEST_F(LfCompositorQosTest, WhatAnotherViewsSinkSaysIsNoConcern) {
  start(1, {{"view-id", "3"}});
  tell(for_view(late_by(20 * kFrame, 0), 4));
  one(1);
  pull();
  EXPECT_EQ(last_pts_, kFrame);
}

TEST_F(LfCompositorQosTest, AFlushForgetsIt) {
  start_two_frames_late(kFrame);
  for (GstHarness* harness : {harness_.get(), nodes_[0].get()})
    gst_harness_push_event(harness, gst_event_new_flush_start());
  for (GstHarness* harness : {harness_.get(), nodes_[0].get()}) {
    gst_harness_push_event(harness, gst_event_new_flush_stop(TRUE));
    GstSegment segment;
    gst_segment_init(&segment, GST_FORMAT_TIME);
    gst_harness_push_event(harness, gst_event_new_segment(&segment));
  }
  one(1);
  one(9);
  pull();
  EXPECT_EQ(last_pts_, kFrame);
}

// From the sink to the nodes: each picture takes five times as long as it is shown.
TEST(Qos, ASlowSinkSavesTheCamerasWork) {
  const ArrayFixture array;
  const ElementPtr pipeline = launch("lfviewrequest rig=" + array.rig_path() +
                                     " num-buffers=60 framerate=50/1 ! tee name=r  r. ! queue ! n.request  "
                                     "lfcameranode name=n rig=" +
                                     array.rig_path() +
                                     " ! c.sink_0  r. ! queue ! c.request  "
                                     "lfcompositor name=c rig=" +
                                     array.rig_path() + " ! identity sleep-time=100000 ! fakesink sync=true qos=true");
  ASSERT_TRUE(pipeline);
  const ElementPtr node(gst_bin_get_by_name(GST_BIN(pipeline.get()), "n"));
  const ElementPtr compositor(gst_bin_get_by_name(GST_BIN(pipeline.get()), "c"));
  EXPECT_EQ(run(pipeline.get(), 60), "");
  EXPECT_GT(stat(node.get(), "skipped"), 10u);
  EXPECT_GT(stat(compositor.get(), "skipped"), 10u);
  EXPECT_GT(stat(compositor.get(), "pictures"), 2u);
  EXPECT_EQ(stat(compositor.get(), "pictures") + stat(compositor.get(), "skipped"), 60u);
  EXPECT_EQ(stat(compositor.get(), "incomplete"), 0u);
}

}  // namespace
}  // namespace lf::test
