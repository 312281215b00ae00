// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/assembly.h"

#include <gtest/gtest.h>

#include <memory>

namespace lf {
namespace {

class TrialAnswersTest : public testing::Test {
 protected:
  TrialAnswersTest() {
    FocalMap map = FocalMap::for_view(16, 8);
    map.levels.assign(static_cast<size_t>(map.columns) * map.rows, 9);
    map.nearest = 1;
    request_.view.width = 16;
    request_.view.height = 8;
    request_.view.focus.map = std::make_shared<FocalMap>(map);
    request_.trials = {{Trial::Kind::kPlane, 1}, {Trial::Kind::kPlane, 2}};
    request_.rig_hash = 5;
  }
  std::string add(const std::vector<Moments>& trials, std::optional<GainSum> gains = {}, uint64_t rig_hash = 5) {
    const wire::MomentsHeader header{0, 0, rig_hash, 0, gains};
    return add_moments(wire::encode_moments(header, trials), header, request_, answers_);
  }
  static Moments moments(int columns, int rows, uint16_t luma) {
    Moments out;
    out.reset(columns, rows);
    for (uint16_t& weight : out.weight) weight = 100;
    for (uint16_t& value : out.luma) value = luma;
    return out;
  }
  ViewRequest request_;
  ViewFocus::Answers answers_;
};

TEST_F(TrialAnswersTest, MomentsAddUp) {
  EXPECT_EQ(add({moments(4, 2, 10), moments(4, 2, 20)}), "");
  EXPECT_EQ(add({moments(4, 2, 1), moments(4, 2, 2)}), "");
  ASSERT_EQ(answers_.moments.size(), 2u);
  EXPECT_EQ(answers_.moments[0].luma[7], 11);
  EXPECT_EQ(answers_.moments[1].luma[0], 22);
  EXPECT_EQ(answers_.brightness.columns, 0);
}

TEST_F(TrialAnswersTest, BrightnessAddsUpWhereItWasAskedFor) {
  const GainSum gains{.weight = 3, .log2 = -4};
  EXPECT_NE(add({moments(2, 1, 10)}, gains), "") << "nobody asked";
  request_.gains.ask = true;
  EXPECT_EQ(add({moments(2, 1, 10)}, gains), "");
  EXPECT_EQ(add({moments(2, 1, 5)}, gains), "");
  EXPECT_EQ(answers_.brightness.luma[1], 15);
  EXPECT_EQ(answers_.gains.weight, 6u);
  EXPECT_TRUE(answers_.moments.empty());
}

TEST_F(TrialAnswersTest, WhatWasNotAskedForIsLeftOut) {
  EXPECT_NE(add({moments(4, 2, 10)}), "") << "too few";
  EXPECT_NE(add({moments(5, 2, 10), moments(5, 2, 10)}), "") << "another size";
  EXPECT_EQ(add({moments(4, 2, 10), moments(4, 2, 20)}, {}, 6), "of another rig");
  request_.view.focus.map = nullptr;
  EXPECT_NE(add({moments(4, 2, 10), moments(4, 2, 20)}), "");
  EXPECT_TRUE(answers_.moments.empty());
}

}  // namespace
}  // namespace lf
