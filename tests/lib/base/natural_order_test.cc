// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/natural_order.h"

#include <algorithm>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace lf {
namespace {

TEST(NaturalOrder, NumbersCompareAsNumbers) {
  const std::vector<std::string> sorted = {"",
                                           "0",
                                           "7",
                                           "07x",
                                           "10",
                                           "cam",
                                           "cam1",
                                           "cam1_2",
                                           "cam1_10",
                                           "cam2",
                                           "cam10",
                                           "cam010_1",
                                           "cam11",
                                           "cam99999999999999999999998",
                                           "cam99999999999999999999999",
                                           "camera"};
  std::vector<std::string> mixed = sorted;
  std::ranges::reverse(mixed);
  std::ranges::sort(mixed, natural_less);
  EXPECT_EQ(mixed, sorted);
}

TEST(NaturalOrder, IsAStrictOrder) {
  const std::string names[] = {"a1", "a01", "a001", "a1b", "a01b", "b", "a", "1", "01", ""};
  for (const std::string& a : names) {
    EXPECT_FALSE(natural_less(a, a)) << a;
    for (const std::string& b : names) {
      if (a == b) continue;
      EXPECT_NE(natural_less(a, b), natural_less(b, a)) << a << " " << b;
      for (const std::string& c : names) {
        const bool ascends = natural_less(a, b) && natural_less(b, c);
        EXPECT_TRUE(!ascends || natural_less(a, c)) << a << " " << b << " " << c;
      }
    }
  }
}

}  // namespace
}  // namespace lf
