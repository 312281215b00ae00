// SPDX-License-Identifier: LGPL-2.1-or-later
#include <future>

#include <gst/check/gsttestclock.h>

#include "common/custom_events.h"
#include "gst/gst_test.h"
#include "viewrequest/request_stream.h"

namespace lf::test {
namespace {

GstBuffer* numbered(guint64 number) {
  GstBuffer* buffer = gst_buffer_new();
  GST_BUFFER_OFFSET(buffer) = number;
  return buffer;
}

class RequestRelayTest : public testing::Test {
 protected:
  GstFlowReturn push(guint64 number, bool live = true) {
    bool dropped = false;
    const GstFlowReturn flow = relay_.push(numbered(number), live, &dropped);
    dropped_ += dropped;
    return flow;
  }
  guint64 pop() {
    GstBuffer* buffer = nullptr;
    flow_ = relay_.pop(&buffer);
    const BufferPtr owned(buffer);
    return buffer ? GST_BUFFER_OFFSET(buffer) : 0;
  }

  RequestRelay relay_;
  int dropped_ = 0;
  GstFlowReturn flow_ = GST_FLOW_OK;
};

TEST_F(RequestRelayTest, LiveRelayDropsTheOldestRequest) {
  for (guint64 i = 1; i <= 70; i++) EXPECT_EQ(push(i), GST_FLOW_OK);
  EXPECT_EQ(dropped_, 6);
  EXPECT_EQ(pop(), 7u);
}

TEST_F(RequestRelayTest, NonLiveRelayWaitsForRoom) {
  for (guint64 i = 1; i <= 64; i++) push(i, false);
  auto more = std::async(std::launch::async, [this] { return push(65, false); });
  EXPECT_EQ(pop(), 1u);
  EXPECT_EQ(more.get(), GST_FLOW_OK);
  EXPECT_EQ(dropped_, 0);
}

TEST_F(RequestRelayTest, QueuedRequestsPrecedeTheEnd) {
  push(1);
  relay_.end();
  EXPECT_EQ(push(2), GST_FLOW_EOS);
  EXPECT_EQ(pop(), 1u);
  pop();
  EXPECT_EQ(flow_, GST_FLOW_EOS);
  relay_.set_flushing(true);
  EXPECT_EQ(push(3), GST_FLOW_FLUSHING);
  relay_.set_flushing(false);
  EXPECT_EQ(push(4), GST_FLOW_OK) << "a flush clears EOS";
  relay_.set_unlocked(true);
  pop();
  EXPECT_EQ(flow_, GST_FLOW_FLUSHING);
}

TEST_F(RequestRelayTest, WithoutAPadThereIsNoUpstream) {
  EXPECT_FALSE(relay_.is_on());
  EXPECT_FALSE(relay_.push_upstream(gst_event_new_reconfigure()));
  GstQuery* query = gst_query_new_latency();
  EXPECT_FALSE(relay_.query_upstream(query));
  gst_query_unref(query);
}

TEST_F(RequestRelayTest, CapsAreForwardedOnceAsParsed) {
  const CapsPtr came(gst_caps_from_string("requests, framerate=(fraction)15/1"));
  relay_.set_caps(came.get());
  const CapsPtr taken(relay_.take_caps());
  const CapsPtr wanted(gst_caps_from_string("requests, framerate=(fraction)15/1, parsed=(boolean)true"));
  EXPECT_TRUE(gst_caps_is_equal(taken.get(), wanted.get()));
  EXPECT_FALSE(relay_.take_caps());
}

TEST(RequestOutbox, BuffersHaveTheTimestampsOfTheirRequest) {
  RequestOutbox outbox;
  const BufferPtr request(numbered(1));
  GST_BUFFER_PTS(request.get()) = 33;
  outbox.put(nullptr, request.get());
  outbox.put(gst_buffer_new_allocate(nullptr, 2, nullptr), request.get());
  outbox.put(gst_buffer_new_allocate(nullptr, 3, nullptr), request.get());
  const BufferPtr first(outbox.take());
  EXPECT_EQ(gst_buffer_get_size(first.get()), 2u);
  EXPECT_EQ(GST_BUFFER_PTS(first.get()), 33u);
  outbox.clear();
  EXPECT_FALSE(outbox.take());
}

class RequestPacerTest : public testing::Test {
 protected:
  ~RequestPacerTest() override { gst_object_unref(clock_); }
  std::future<GstFlowReturn> wait(GstClockTime time, bool or_change = false) {
    auto result = std::async(std::launch::async, [=, this] { return turn_.wait_until(clock_, time, or_change); });
    gst_test_clock_wait_for_multiple_pending_ids(GST_TEST_CLOCK(clock_), 1, nullptr);
    return result;
  }

  GstClock* clock_ = gst_test_clock_new();
  RequestPacer turn_;
};

TEST_F(RequestPacerTest, WaitsForTheTime) {
  auto result = wait(GST_SECOND);
  turn_.note_change();
  EXPECT_TRUE(gst_test_clock_crank(GST_TEST_CLOCK(clock_)));
  EXPECT_EQ(result.get(), GST_FLOW_OK);
  EXPECT_EQ(gst_clock_get_time(clock_), GST_SECOND);
}

TEST_F(RequestPacerTest, ChangeEndsTheWait) {
  auto result = wait(GST_SECOND, true);
  turn_.note_change();
  EXPECT_EQ(result.get(), GST_FLOW_OK);
  EXPECT_EQ(turn_.wait_until(clock_, GST_SECOND, true), GST_FLOW_OK) << "not requested yet";
  turn_.forget_change();
  result = wait(GST_SECOND, true);
  EXPECT_TRUE(gst_test_clock_crank(GST_TEST_CLOCK(clock_)));
  EXPECT_EQ(result.get(), GST_FLOW_OK);
}

TEST_F(RequestPacerTest, UnlockEndsWaits) {
  auto result = wait(GST_SECOND, true);
  turn_.set_unlocked(true);
  EXPECT_EQ(result.get(), GST_FLOW_FLUSHING);
  EXPECT_EQ(turn_.wait_until(clock_, GST_SECOND), GST_FLOW_FLUSHING);
  turn_.hold(7, true);
  EXPECT_EQ(turn_.wait_for_seek(), GST_FLOW_FLUSHING);
  turn_.set_unlocked(false);
  turn_.hold(7, false);
  EXPECT_EQ(turn_.wait_for_seek(), GST_FLOW_OK);
}

TEST_F(RequestPacerTest, RequestsAreHeldUntilTheLatestSeekEnds) {
  turn_.hold(7, true);
  turn_.hold(8, true);
  auto result = std::async(std::launch::async, [this] { return turn_.wait_for_seek(); });
  turn_.hold(7, false);
  EXPECT_EQ(result.wait_for(std::chrono::milliseconds(20)), std::future_status::timeout);
  turn_.hold(8, false);
  EXPECT_EQ(result.get(), GST_FLOW_OK);
  turn_.hold(9, true);
  turn_.forget_seek();
  EXPECT_EQ(turn_.wait_for_seek(), GST_FLOW_OK);
}

TEST(SeekFilter, RecognisesTheLatestSeek) {
  SeekFilter seek;
  EXPECT_TRUE(seek.is_new(5));
  EXPECT_FALSE(seek.is_new(5));
  EXPECT_TRUE(seek.is_new(6));
  seek.clear();
  EXPECT_TRUE(seek.is_new(6));
}

}  // namespace
}  // namespace lf::test
