// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/turn.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace lf::serve {
namespace {

TEST(Turn, ViewersThatComeOneAfterTheOtherAreFarApart) {
  for (const uint32_t first : {0u, 1u, 6u, 1000000u, 4294967280u})
    for (const int count : {1, 2, 4, 8}) {
      std::vector<double> turns;
      for (int i = 0; i < count; i++) turns.push_back(turn_of(first + static_cast<uint32_t>(i)));
      std::ranges::sort(turns);
      EXPECT_GE(turns.front(), 0);
      EXPECT_LT(turns.back(), 1);
      turns.push_back(turns.front() + 1);  // the next picture's
      for (size_t i = 1; i < turns.size(); i++)
        EXPECT_GE(turns[i] - turns[i - 1], 0.5 / count) << count << " viewers from " << first;
    }
}

}  // namespace
}  // namespace lf::serve
