// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/recent.h"

#include <gtest/gtest.h>

#include <array>

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

TEST(Recent, ValuesStayWhereTheyAre) {
  Recent<std::array<char, 8192>> values(64);
  const auto* first = &values[0];
  for (uint32_t key = 1; key < 64; key++) values[key];
  for (uint32_t key = 63; key > 0; key--) values[key];
  EXPECT_EQ(&values[0], first);
}

}  // namespace
}  // namespace lf::rtp
