// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/maths.h"

#include "support/test.h"

namespace lf {
namespace {

TEST(Percentiles, NearestRank) {
  Percentiles p;
  EXPECT_EQ(p.at(50), 0u);
  for (uint64_t v = 100; v >= 1; v--) p.add(v);
  EXPECT_EQ(p.at(50), 50u);
  EXPECT_EQ(p.at(95), 95u);
  EXPECT_EQ(p.at(100), 100u);
  EXPECT_EQ(p.at(0.1), 1u);
}

TEST(Percentiles, OneSampleIsEveryPercentile) {
  Percentiles p;
  p.add(7);
  EXPECT_EQ(p.at(1), 7u);
  EXPECT_EQ(p.at(99), 7u);
}

TEST(Percentiles, OldSamplesAreForgotten) {
  Percentiles p(10);
  for (uint64_t v = 0; v < 10; v++) p.add(1000);
  for (uint64_t v = 0; v < 10; v++) p.add(1);
  EXPECT_EQ(p.at(100), 1u);
  p.clear();
  EXPECT_EQ(p.at(100), 0u);
}

}  // namespace
}  // namespace lf
