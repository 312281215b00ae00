// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/schedule.h"

#include "support/test.h"

namespace lf {
namespace {

TEST(Schedule, InstantsOfFifteenFramesPerSecond) {
  const Schedule s(15, 1);
  EXPECT_EQ(s.instant(0), 0u);
  EXPECT_EQ(s.instant(1), 66'666'666u);
  EXPECT_EQ(s.instant(2), 133'333'333u);
  EXPECT_EQ(s.instant(15), 1'000'000'000u);
  EXPECT_EQ(s.period(), 66'666'666u);
}

TEST(Schedule, DoesNotDriftAtLargeClockTimes) {
  const Schedule s(30000, 1001);
  // 30000 periods are exactly 1001 seconds over the whole range of 64-bit nanoseconds.
  for (uint64_t n : {1u, 1'000'000u, 18'000'000u}) EXPECT_EQ(s.instant(30000 * n), 1001 * n * 1'000'000'000ull);
}

TEST(Schedule, IndexIsTheInverse) {
  std::mt19937_64 random(1);
  for (const auto& [n, d] : {std::pair{15, 1}, {30000, 1001}, {1, 3600}, {1000, 1}, {2147483647, 1}, {7, 3}}) {
    const Schedule s(n, d);
    for (int i = 0; i < 2000; i++) {
      const uint64_t t = random() >> (2 + random() % 60);
      const uint64_t k = s.index_at(t);
      EXPECT_LE(s.instant(k), t);
      EXPECT_GT(s.instant(k + 1), t);
      const uint64_t first = s.first_from(t);
      EXPECT_GE(s.instant(first), t);
      EXPECT_TRUE(first == 0 || s.instant(first - 1) < t);
    }
    if (s.period() == 0) continue;  // several instants per nanosecond
    for (uint64_t k = 0; k < 100; k++) EXPECT_EQ(s.index_at(s.instant(k)), k);
  }
}

}  // namespace
}  // namespace lf
