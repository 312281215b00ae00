// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/capture_timeline.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

constexpr GstClockTime kBegin = 1'800'000'000 * GST_SECOND;
constexpr gint64 kPeriod = 40 * GST_MSECOND;

class CaptureTimelineTest : public testing::Test {
 protected:
  CaptureTimeline::Place at(uint32_t camera, gint64 clock) { return timeline_.place(camera, kBegin + clock); }
  gint64 time(uint32_t camera, gint64 clock) { return at(camera, clock).time; }

  CaptureTimeline timeline_{kBegin};
};

TEST_F(CaptureTimelineTest, TimesCountFromTheBeginning) {
  for (const uint32_t camera : {0, 1})
    for (gint64 i = 0; i < 5; i++) EXPECT_EQ(time(camera, i * kPeriod + camera), i * kPeriod + camera);
  EXPECT_EQ(time(2, -kPeriod), -kPeriod) << "before it";
  EXPECT_EQ(time(0, 60 * GST_SECOND), gint64{60 * GST_SECOND}) << "it was away";
  EXPECT_EQ(time(0, 59 * GST_SECOND + kPeriod), gint64{59 * GST_SECOND + kPeriod}) << "less than a second late";
}

TEST_F(CaptureTimelineTest, OneThatHasStrayedMovesNothing) {
  for (gint64 i = 0; i < 200; i++) {
    if (i % 50 == 40) {
      EXPECT_LT(time(0, (i - 30) * kPeriod), (i - 25) * kPeriod);
    }
    EXPECT_EQ(time(0, i * kPeriod), i * kPeriod);
  }
}

// Frames of before are still on their way when the first one of afterwards comes.
TEST_F(CaptureTimelineTest, CamerasStayInStepWhereTheClockIsSetBack) {
  constexpr gint64 kHour = 3600 * GST_SECOND;
  for (const gint64 back : {gint64{2 * GST_SECOND}, kHour}) {
    SCOPED_TRACE(back);
    timeline_ = CaptureTimeline(kBegin);
    const auto clock = [&](gint64 i) { return i * kPeriod - (i < 100 ? 0 : back); };
    for (gint64 i = 0; i < 200; i++) {
      const CaptureTimeline::Place first = at(0, clock(i));
      EXPECT_EQ(first.time, i * kPeriod - (i == 100 ? back : 0)) << "the first one may have strayed";
      EXPECT_EQ(first.set_back, i == 101 ? back : 0);
      for (const gint64 behind : {1, 5})
        if (i >= behind) {
          const CaptureTimeline::Place other = at(behind, clock(i - behind) + 3);
          EXPECT_EQ(other.time, (i - behind) * kPeriod + 3) << behind;
          EXPECT_EQ(other.set_back, 0);
        }
    }
    EXPECT_EQ(time(9, clock(200)), 200 * kPeriod) << "one that comes only now";
  }
}

TEST_F(CaptureTimelineTest, ACameraThatWasAwayMeanwhileIsInStepAgain) {
  for (gint64 i = 0; i < 10; i++) EXPECT_EQ(time(1, i * kPeriod), i * kPeriod);
  constexpr gint64 kBack = 5 * GST_SECOND;
  const auto see = [&](gint64 i, gint64 back) {
    const gint64 seen = time(0, i * kPeriod - back);
    if (i != 100 && i != 1500 && i != 1700) {
      EXPECT_EQ(seen, i * kPeriod);
    }
  };
  for (gint64 i = 0; i < 1000; i++) see(i, i < 100 ? 0 : kBack);
  EXPECT_EQ(time(1, 1000 * kPeriod - kBack), 1000 * kPeriod);
  EXPECT_EQ(time(2, 1000 * kPeriod - kBack), 1000 * kPeriod) << "its first";
  // Set back again, twice while camera 1 gives nothing.
  for (gint64 i = 1000; i < 2000; i++) see(i, kBack * (1 + i / 1500 + i / 1700));
  EXPECT_EQ(time(1, 2000 * kPeriod - 3 * kBack), 2000 * kPeriod);
}

// Whose clock alone is wrong is put behind what it has given, and no other camera is.
TEST_F(CaptureTimelineTest, OthersStayWhereTheClockOfOneCameraIsSetBack) {
  for (gint64 i = 0; i < 200; i++) {
    EXPECT_EQ(time(0, i * kPeriod), i * kPeriod);
    const gint64 seen = time(1, i * kPeriod - (i < 100 ? 0 : 60 * GST_SECOND));
    if (i == 100) continue;
    EXPECT_EQ(seen, i * kPeriod);
  }
  EXPECT_EQ(time(0, 1000 * kPeriod), 1000 * kPeriod) << "after a gap";
  EXPECT_EQ(time(2, 1000 * kPeriod), 1000 * kPeriod) << "its first";
}

}  // namespace
}  // namespace lf
