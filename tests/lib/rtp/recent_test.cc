// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/recent.h"

#include <gtest/gtest.h>

namespace lf::rtp {
namespace {

TEST(Recent, ForgetsTheKeyUsedLongestAgo) {
  Recent<int> values(3);
  for (const uint32_t key : {10, 11, 12}) values[key] = static_cast<int>(key);
  EXPECT_EQ(values[10], 10);
  values[13] = 13;  // in place of 11
  EXPECT_EQ(values.size(), 3u);
  EXPECT_EQ(values[10], 10);
  EXPECT_EQ(values[12], 12);
  EXPECT_EQ(values[13], 13);
  EXPECT_EQ(values[11], 0);
  values.clear();
  EXPECT_EQ(values[13], 0);
}

}  // namespace
}  // namespace lf::rtp
