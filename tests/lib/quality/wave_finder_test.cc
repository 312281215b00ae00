// SPDX-License-Identifier: LGPL-2.1-or-later
#include "quality/wave_finder.h"

#include <gtest/gtest.h>

#include <random>

namespace lf {
namespace {

// Four cameras that look at one scene, with noise; parts are bright and dark in turn.
class WaveTest : public testing::Test {
 protected:
  // What changes a camera's parts, for so many seconds.
  template <typename Change>
  void pass(double seconds, Change change) {
    for (const double end = time_ + seconds; time_ < end; time_ += 0.2)
      for (size_t camera = 0; camera < 4; camera++) {
        std::vector<float> parts(48);
        for (size_t i = 0; i < parts.size(); i++) parts[i] = (i % 2 ? 0.7f : 0.3f) + noise_(random_);
        change(camera, parts);
        finder_.see(camera, parts, time_);
      }
  }
  static void nothing(size_t, std::vector<float>&) {}
  std::mt19937 random_{1};
  std::normal_distribution<float> noise_{0, 0.01f};
  double time_ = 100;
  WaveFinder finder_{4};
};

TEST_F(WaveTest, FindsTheCameraBehindTheHandUntilItGoes) {
  pass(2, nothing);
  EXPECT_EQ(finder_.found(), std::nullopt);
  for (const size_t which : {2, 0}) {
    pass(1, [=](size_t camera, std::vector<float>& parts) {
      if (camera == which) std::fill(parts.begin(), parts.end(), 0.15f);
    });
    EXPECT_EQ(finder_.found(), which);
    EXPECT_GT(finder_.change(which), 0.15);
    pass(1, nothing);
    EXPECT_EQ(finder_.found(), std::nullopt);
  }
}

TEST_F(WaveTest, IsNotFooledByWhatAllSeeOrByLight) {
  pass(2, nothing);
  pass(1, [](size_t, std::vector<float>& parts) { std::fill(parts.begin(), parts.begin() + 24, 0.1f); });
  EXPECT_EQ(finder_.found(), std::nullopt) << "somebody walks past";
  pass(30, nothing);
  pass(1, [](size_t camera, std::vector<float>& parts) {
    for (float& part : parts) part += camera == 1 ? 0.1f : 0.f;
  });
  EXPECT_EQ(finder_.found(), std::nullopt) << "a camera's exposure";
}

TEST_F(WaveTest, WhatStaysBecomesUsual) {
  const auto covered = [](size_t camera, std::vector<float>& parts) {
    if (camera == 3) std::fill(parts.begin(), parts.end(), 0.1f);
  };
  pass(2, nothing);
  pass(1, covered);
  EXPECT_EQ(finder_.found(), 3u);
  pass(60, covered);
  EXPECT_EQ(finder_.found(), std::nullopt);
}

TEST(Wave, NobodyIsFoundWhereNobodyIs) {
  EXPECT_EQ(WaveFinder(0).found(), std::nullopt);
  EXPECT_EQ(WaveFinder(1).found(), std::nullopt);
}

}  // namespace
}  // namespace lf
