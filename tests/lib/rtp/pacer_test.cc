// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/pacer.h"

#include <gtest/gtest.h>

namespace lf::rtp {
namespace {

TEST(Pacer, SpreadsABurst) {
  Pacer pacer;
  EXPECT_EQ(pacer.next(1000), 1000u);
  pacer.sent(1000, 1000, 8'000'000);  // a millisecond
  EXPECT_EQ(pacer.next(1000), 1'001'000u - Pacer::kAhead);
  pacer.sent(1'001'000, 500, 8'000'000);
  EXPECT_EQ(pacer.next(1'002'000), 1'501'000u - Pacer::kAhead);
}

// However many there are, they come to the rate.
TEST(Pacer, IsNeverFartherAheadThanThat) {
  Pacer pacer;
  uint64_t now = 5'000'000;
  for (uint64_t i = 0; i < 1000; i++) {
    now = pacer.next(now);
    pacer.sent(now, 1000, 80'000'000);  // 0.1 ms each
    EXPECT_GE(now + Pacer::kAhead, 5'000'000 + i * 100'000);
    EXPECT_LE(now, 5'000'000 + i * 100'000);
  }
}

TEST(Pacer, DoesNotMakeUpForSilence) {
  Pacer pacer;
  pacer.sent(0, 1000, 8'000'000);
  EXPECT_EQ(pacer.next(1'000'000'000), 1'000'000'000u);
  pacer.sent(1'000'000'000, 1000, 8'000'000);
  EXPECT_EQ(pacer.next(1'000'000'000), 1'001'000'000u - Pacer::kAhead);
  pacer.clear();
  EXPECT_EQ(pacer.next(5), 5u);
}

TEST(Pacer, DoesNotWaitForAClockThatHasBeenSetBack) {
  Pacer pacer;
  pacer.sent(pacer.next(3'600'000'000'000), 1000, 8'000'000);
  EXPECT_EQ(pacer.next(1'000'000'000), 1'000'000'000u);
  pacer.sent(1'000'000'000, 1000, 8'000'000);
  EXPECT_EQ(pacer.next(1'000'000'000), 1'001'000'000u - Pacer::kAhead);
}

}  // namespace
}  // namespace lf::rtp
