// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/gain_matcher.h"

#include <gtest/gtest.h>

#include <cmath>
#include <deque>
#include <utility>

#include "focus/camera_gains.h"

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
  const float first = matcher.gains_for(1, mean_of(7, 100)).likely(3);
  EXPECT_GT(first, 1.05);
  EXPECT_EQ(matcher.gains_for(1, mean_of(7, 100)).likely(3), first) << "once";
  EXPECT_EQ(matcher.gains_for(1, {}).of(3), 1) << "of a mean that all have made";
  for (const uint32_t sequence : {8, 9}) {
    matcher.keep(1, sequence, {seen(3, 100)});
    matcher.gains_for(1, mean_of(sequence, 100));
  }
  const float gain = matcher.gains_for(1, {}).of(3);
  EXPECT_EQ(gain, first);
  EXPECT_EQ(matcher.gains_for(9, {}).of(3), gain) << "a view that is new begins there";
  matcher.clear();
  EXPECT_EQ(matcher.gains_for(1, {}).of(3), 1);
}

// A camera is 20 % too bright, and each request comes `underway` requests before what came of it is sent.
TEST(GainMatcher, ManyRequestsUnderwayFindTheGain) {
  for (const size_t underway : {1, 2, 3, 5, 8, 16}) {
    GainMatcher matcher;
    MeanTurns turns;
    std::deque<std::pair<bool, GainRequest>> requests(underway);  // what they ask, what they bring
    float largest = 0;
    for (uint32_t i = 0; i < 16 * (underway + 3); i++) {
      const auto [asks, brings] = requests.front();
      requests.pop_front();
      const float gain = matcher.gains_for(1, brings).likely(3);
      largest = std::max(largest, gain);
      if (asks) matcher.keep(1, i, {seen(3, static_cast<uint8_t>(std::lround(120 / gain)))});
      requests.emplace_back(turns.next(true, asks), asks ? mean_of(i, 100) : GainRequest());
    }
    EXPECT_NEAR(matcher.gains_for(1, {}).of(3), 1.2, 0.01) << underway;
    EXPECT_LT(largest, 1.21) << underway;
  }
}

TEST(GainMatcher, DividesImages) {
  Image grey(PixelFamily::kRgb, 8, 8);
  std::ranges::fill(grey.data(), 110);
  const Camera camera{.width = 8, .height = 8};
  const std::vector<Source> sources{{0, &camera, grey.view()}, {1, &camera, grey.view()}, {2, &camera, {}}};
  CameraGains gains;
  for (unsigned i = 0; i < CameraGains::kMeans; i++)
    gains.take({{0, {std::log(1.5f / gains.likely(0)), 0}}, {2, {std::log(1.5f / gains.likely(2)), 0}}});
  ASSERT_NEAR(gains.of(0), 1.5, 0.001);
  std::vector<ByteBuffer> memory;
  const std::vector<Source> out = GainMatcher::match(
      sources, gains,
      [](CameraIndex) {
        return Rect{0, 0, 8, 8};
      },
      memory);
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
