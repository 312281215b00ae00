// SPDX-License-Identifier: LGPL-2.1-or-later
#include "viewrequest/request_turn.h"

#include <gst/check/gsttestclock.h>
#include <gtest/gtest.h>

#include <future>

#include "common/seek_once.h"

namespace lf {
namespace {

class RequestTurnTest : public testing::Test {
 protected:
  ~RequestTurnTest() override { gst_object_unref(clock_); }
  std::future<GstFlowReturn> wait(GstClockTime time, bool or_change = false) {
    auto result = std::async(std::launch::async, [=, this] { return turn_.wait_until(clock_, time, or_change); });
    gst_test_clock_wait_for_multiple_pending_ids(GST_TEST_CLOCK(clock_), 1, nullptr);
    return result;
  }

  GstClock* clock_ = gst_test_clock_new();
  RequestTurn turn_;
};

TEST_F(RequestTurnTest, WaitsForItsTime) {
  auto result = wait(GST_SECOND);
  turn_.note_change();
  EXPECT_TRUE(gst_test_clock_crank(GST_TEST_CLOCK(clock_)));
  EXPECT_EQ(result.get(), GST_FLOW_OK);
  EXPECT_EQ(gst_clock_get_time(clock_), GST_SECOND);
}

TEST_F(RequestTurnTest, AChangeEndsAWaitThatIsForOne) {
  auto result = wait(GST_SECOND, true);
  turn_.note_change();
  EXPECT_EQ(result.get(), GST_FLOW_OK);
  EXPECT_EQ(turn_.wait_until(clock_, GST_SECOND, true), GST_FLOW_OK) << "it has not been asked for yet";
  turn_.forget_change();
  result = wait(GST_SECOND, true);
  EXPECT_TRUE(gst_test_clock_crank(GST_TEST_CLOCK(clock_)));
  EXPECT_EQ(result.get(), GST_FLOW_OK);
}

TEST_F(RequestTurnTest, NobodyWaitsWhileUnlocked) {
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

TEST_F(RequestTurnTest, NothingLeavesUntilTheLatestSeekIsOver) {
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

TEST(SeekOnce, KnowsTheLatest) {
  SeekOnce seek;
  EXPECT_TRUE(seek.is_new(5));
  EXPECT_FALSE(seek.is_new(5));
  EXPECT_TRUE(seek.is_new(6));
  seek.clear();
  EXPECT_TRUE(seek.is_new(6));
}

}  // namespace
}  // namespace lf
