// SPDX-License-Identifier: LGPL-2.1-or-later
#include "quality/outliers.h"

#include <gtest/gtest.h>

#include <cmath>

namespace lf {
namespace {

TEST(Outliers, AreFarBelowTheOthers) {
  EXPECT_EQ(unusually_low({30, 31, 29.5, 22, 30.5, 30}), (std::vector<size_t>{3}));
  EXPECT_EQ(unusually_low({30, 31, 29.5, 28, 30.5, 30}), std::vector<size_t>()) << "2 dB are nothing unusual";
  EXPECT_EQ(unusually_low({20, 35, 25, 40, 30, 22}), std::vector<size_t>()) << "nor is anything where all differ";
  EXPECT_EQ(unusually_low({30, 31, 60, 30, 30.5}), std::vector<size_t>()) << "nor are good ones";
}

TEST(Outliers, NeedNumbers) {
  EXPECT_EQ(unusually_low({}), std::vector<size_t>());
  EXPECT_EQ(unusually_low({NAN, NAN}), std::vector<size_t>());
  EXPECT_EQ(unusually_low({NAN, 30, 30, 30, 10, INFINITY}), (std::vector<size_t>{4}));
}

TEST(Outliers, ABadCameraDoesNotAccuseItsNeighbours) {
  // Camera 3 is off: its neighbours 2 and 4 are predicted badly as long as it takes part; 7 is off, too.
  const std::vector<double> with_all{30, 30.5, 20, 15, 21, 30, 31, 16, 29.5, 30, 30.2, 30.1};
  std::vector<std::vector<size_t>> asked;
  const auto predict = [&](size_t camera, const std::vector<size_t>& without) {
    asked.push_back(without);
    return camera == 7 ? 16. : 29.;
  };
  EXPECT_EQ(find_suspects(with_all, predict), (std::vector<size_t>{3, 7}));
  EXPECT_EQ(asked, (std::vector<std::vector<size_t>>{{3}, {3}, {3}}));
  EXPECT_EQ(find_suspects({30, 30, 30}, predict), std::vector<size_t>());
}

}  // namespace
}  // namespace lf
