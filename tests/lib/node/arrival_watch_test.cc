// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/arrival_watch.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

constexpr uint64_t kMs = 1'000'000;

TEST(ArrivalWatch, WhatAllButOneOfAHundredTakeAndHalfAFrame) {
  ArrivalWatch watch;
  EXPECT_EQ(watch.needed(40 * kMs, 0), 0u) << "nothing is known";
  for (uint64_t i = 1; i <= 200; i++) watch.arrived(i * 40 * kMs, i * 40 * kMs + (i == 150 ? 500 : 10 + i % 10) * kMs);
  EXPECT_EQ(watch.needed(40 * kMs, 200 * 40 * kMs + 20 * kMs), (19 + 20) * kMs);
  EXPECT_EQ(watch.needed(0, 200 * 40 * kMs + 20 * kMs), 19 * kMs);
}

TEST(ArrivalWatch, OldFramesAreForgotten) {
  ArrivalWatch watch;
  for (uint64_t i = 1; i <= 200; i++) watch.arrived(i * kMs, i * kMs + 300 * kMs);
  EXPECT_EQ(watch.needed(0, 500 * kMs), 300 * kMs);
  for (uint64_t i = 201; i <= 201 + ArrivalWatch::kFrames; i++) watch.arrived(i * kMs, i * kMs + 5 * kMs);
  EXPECT_EQ(watch.needed(0, 500 * kMs), 5 * kMs);
}

TEST(ArrivalWatch, ACameraThatIsGoneNeedsNothing) {
  ArrivalWatch watch;
  watch.arrived(100 * kMs, 130 * kMs);
  EXPECT_EQ(watch.needed(0, 130 * kMs + ArrivalWatch::kSilence), 30 * kMs);
  EXPECT_EQ(watch.needed(0, 131 * kMs + ArrivalWatch::kSilence), 0u);
  watch.arrived(10'000 * kMs, 9'990 * kMs);
  EXPECT_EQ(watch.needed(0, 10'000 * kMs), 30 * kMs) << "a stamp from the future counts as no delay";
}

}  // namespace
}  // namespace lf
