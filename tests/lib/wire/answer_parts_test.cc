// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/answer_parts.h"

#include <gtest/gtest.h>

namespace lf::wire {
namespace {

TEST(AnswerParts, AnyOrderCompletes) {
  AnswerParts parts;
  EXPECT_FALSE(parts.complete());
  EXPECT_TRUE(parts.add({7, 3, 10}));
  EXPECT_TRUE(parts.add({0, 4, 10}));
  EXPECT_FALSE(parts.complete());
  EXPECT_TRUE(parts.add({4, 3, 10}));
  EXPECT_TRUE(parts.complete());
  parts.clear();
  EXPECT_FALSE(parts.complete());
}

TEST(AnswerParts, AnAnswerWithoutFragmentsIsCompleteAtOnce) {
  AnswerParts parts;
  EXPECT_TRUE(parts.add({0, 0, 0}));
  EXPECT_TRUE(parts.complete());
  EXPECT_FALSE(parts.add({0, 0, 0}));
}

TEST(AnswerParts, RepetitionsAndContradictionsChangeNothing) {
  AnswerParts parts;
  EXPECT_TRUE(parts.add({4, 4, 10}));
  EXPECT_FALSE(parts.add({4, 4, 10}));
  EXPECT_FALSE(parts.add({6, 4, 10}));
  EXPECT_FALSE(parts.add({2, 3, 10}));
  EXPECT_FALSE(parts.add({0, 10, 10}));
  EXPECT_FALSE(parts.add({5, 1, 10}));
  EXPECT_FALSE(parts.add({0, 4, 9}));
  EXPECT_TRUE(parts.add({8, 2, 10}));
  EXPECT_TRUE(parts.add({0, 4, 10}));
  EXPECT_TRUE(parts.complete());
}

}  // namespace
}  // namespace lf::wire
