// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/arrival_watch.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

constexpr uint64_t kSecond = DelayNotice::kSecond, kBegin = 1000 * kSecond;

TEST(DelayNotice, WhatGrowsIsToldSoon) {
  DelayNotice notice;
  ASSERT_TRUE(notice.is_due(kBegin));
  EXPECT_TRUE(notice.see(30, kBegin));
  EXPECT_FALSE(notice.is_due(kBegin + kSecond / 20));
  ASSERT_TRUE(notice.is_due(kBegin + kSecond / 10));
  EXPECT_TRUE(notice.see(31, kBegin + kSecond / 10));
}

TEST(DelayNotice, TheSameIsToldOnceASecond) {
  DelayNotice notice;
  EXPECT_TRUE(notice.see(30, kBegin));
  EXPECT_FALSE(notice.see(30, kBegin + kSecond / 2));
  EXPECT_FALSE(notice.see(20, kBegin + kSecond - 1));
  EXPECT_TRUE(notice.see(20, kBegin + kSecond));
}

TEST(DelayNotice, WhileNothingIsKnownItIsLookedAtAgain) {
  DelayNotice notice;
  EXPECT_FALSE(notice.see(0, kBegin));
  EXPECT_TRUE(notice.is_due(kBegin + 1));
  EXPECT_TRUE(notice.see(30, kBegin + 1));
}

}  // namespace
}  // namespace lf
