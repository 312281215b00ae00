// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/gain_matcher.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

constexpr size_t kNodes = 100;

WideLuma::Camera seen(CameraIndex camera, uint8_t luma) {
  return {camera, std::vector<uint8_t>(kNodes, luma), std::vector<float>(kNodes, WideLuma::kPeak)};
}

GainRequest mean_of(uint32_t sequence, uint8_t luma) {
  return {.use = true, .mean = std::vector<uint8_t>(kNodes, luma), .mean_of = sequence};
}

TEST(GainMatcher, ComparesWithTheMeanOfTheSameRequest) {
  GainMatcher matcher;
  matcher.keep(1, 7, {seen(3, 110)});
  EXPECT_EQ(matcher.gains_for(1, mean_of(6, 100)).of(3), 1) << "of another request";
  EXPECT_EQ(matcher.gains_for(2, mean_of(7, 100)).of(3), 1) << "of another view";
  const float gain = matcher.gains_for(1, mean_of(7, 100)).of(3);
  EXPECT_GT(gain, 1.05);
  EXPECT_EQ(matcher.gains_for(1, mean_of(7, 100)).of(3), gain) << "once";
  EXPECT_EQ(matcher.gains_for(9, {}).of(3), gain) << "a view that is new begins there";
  matcher.clear();
  EXPECT_EQ(matcher.gains_for(1, {}).of(3), 1);
}

TEST(GainMatcher, DividesImages) {
  Image grey(PixelFamily::kRgb, 8, 8);
  std::ranges::fill(grey.data(), 110);
  const Camera camera{.width = 8, .height = 8};
  const std::vector<Source> sources{{0, &camera, grey.view()}, {1, &camera, grey.view()}, {2, &camera, {}}};
  CameraGains gains;
  gains.update(0, 1.5f);
  gains.update(2, 1.5f);
  GainMatcher matcher;
  const std::vector<Source> out = matcher.match(sources, gains, [](CameraIndex) { return Rect{0, 0, 8, 8}; });
  EXPECT_NEAR(out[0].image.plane[0][100], 110 / gains.of(0), 1);
  EXPECT_EQ(out[1].image.plane[0], grey.view().plane[0]) << "costs nothing";
  EXPECT_EQ(out[2].image.family, PixelFamily::kNone);
}

TEST(GainMatcher, ForgetsViewsThatAreGone) {
  GainMatcher matcher;
  for (uint32_t view = 0; view < 1000; view++) {
    matcher.keep(view, 1, {seen(0, 120)});
    if (view <= 500) continue;
    EXPECT_EQ(matcher.gains_for(0, mean_of(1, 100)).of(0), 1) << "forgotten";
  }
}

}  // namespace
}  // namespace lf
