// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/camera_stream.h"
#include "gst/gst_test.h"

namespace lf::test {
namespace {

constexpr GstClockTime kPeriod = GST_SECOND / 30;

BufferPtr picture(bool is_key) {
  BufferPtr buffer(to_buffer(std::vector<uint8_t>(10, 1)));
  if (!is_key) GST_BUFFER_FLAG_SET(buffer.get(), GST_BUFFER_FLAG_DELTA_UNIT);
  return buffer;
}

TEST(PendingCodedFramesTest, BeginsWithAKeyFrame) {
  PendingCodedFrames pictures;
  EXPECT_FALSE(pictures.admits(picture(false).get()));
  EXPECT_TRUE(pictures.admits(picture(true).get()));
  EXPECT_TRUE(pictures.admits(picture(false).get()));
  pictures.begin_again();
  EXPECT_FALSE(pictures.admits(picture(false).get()));
}

TEST(PendingCodedFramesTest, PendingFramesStartWithAKeyFrame) {
  PendingCodedFrames pictures;
  for (GstClockTime i = 0; i < 5; i++) pictures.wait(picture(i == 2).get(), i * kPeriod);
  const auto waiting = pictures.take_waiting();
  ASSERT_EQ(waiting.size(), 3u);
  EXPECT_EQ(waiting[0].taken, 2 * kPeriod);
  EXPECT_TRUE(pictures.take_waiting().empty());
  EXPECT_TRUE(pictures.admits(picture(false).get())) << "the key frame was admitted";
}

TEST(PendingCodedFramesTest, PendingFramesAreBounded) {
  PendingCodedFrames pictures;
  for (size_t i = 0; i < PendingCodedFrames::kMaxPending + 5; i++) pictures.wait(picture(i == 0).get(), i * kPeriod);
  EXPECT_TRUE(pictures.take_waiting().empty());
  EXPECT_FALSE(pictures.admits(picture(false).get()));
}

// A sender report that arrives after the first frames shifts the capture times by -200 ms.
TEST(PendingCodedFramesTest, CaptureTimesKeepIncreasingAfterAJumpBack) {
  PendingCodedFrames pictures;
  constexpr GstClockTime kBegin = 1000 * GST_SECOND, kJump = GST_SECOND / 5;
  GstClockTime before = 0;
  for (GstClockTime i = 0; i < 30; i++) {
    const GstClockTime captured = kBegin + i * kPeriod - (i < 10 ? 0 : kJump);
    const GstClockTime time = pictures.in_order(i * kPeriod, captured);
    EXPECT_GT(time, before) << i;
    EXPECT_LT(time, captured + kJump + kPeriod) << i;
    if (i < 10 || i > 17) {
      EXPECT_EQ(time, captured) << i;
    }
    before = time;
  }
}

TEST(PendingCodedFramesTest, DecodingOrderMayDifferFromDisplayOrder) {
  PendingCodedFrames pictures;
  for (const GstClockTime i : {0, 3, 1, 2, 6, 4, 5})
    EXPECT_EQ(pictures.in_order(i * kPeriod, GST_SECOND + i * kPeriod), GST_SECOND + i * kPeriod) << i;
}

TEST(PendingCodedFramesTest, LargeClockStepsAreKept) {
  PendingCodedFrames pictures;
  pictures.in_order(kPeriod, 100 * GST_SECOND);
  EXPECT_EQ(pictures.in_order(2 * kPeriod, 40 * GST_SECOND), 40 * GST_SECOND);
}

}  // namespace
}  // namespace lf::test
