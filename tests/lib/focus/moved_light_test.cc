// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/moved_light.h"

#include <gtest/gtest.h>

#include <functional>

namespace lf {
namespace {

constexpr int kColumns = 40, kRows = 24;

// What cameras of this luma add up to; `weight` of all.
Moments moments_of(const std::function<double(int x, int y)>& luma, double weight = 1) {
  Moments m;
  m.reset(kColumns, kRows);
  for (int y = 0; y < kRows; y++)
    for (int x = 0; x < kColumns; x++) {
      const size_t i = static_cast<size_t>(y) * kColumns + x;
      m.weight[i] = static_cast<uint16_t>(weight * Moments::kWeightOne);
      m.luma[i] = static_cast<uint16_t>(weight * luma(x, y) * Moments::kLumaOne);
    }
  return m;
}
const std::vector<uint8_t> kFirst(kColumns* kRows, 0);

double wall(int, int) { return 200; }
double thing(int x, int y) { return x >= 4 && x < 12 && y >= 4 && y < 10 ? 40 : 200; }

TEST(MovedLight, OfWhatIsOnlyBlurredThereIsNone) {
  // The same thing, twice, at half of its contrast.
  const Moments twice = moments_of([](int x, int y) { return (thing(x - 2, y) + thing(x + 2, y)) / 2; });
  EXPECT_NEAR(moved_light(std::vector{moments_of(thing), twice}, kFirst, 1), 0, 1e-6);
}

TEST(MovedLight, AThingThatIsGoneTookItsShadowAlong) {
  // 48 of the 240 nodes of one quarter are 160 levels brighter: 32 in its mean, 0 in the others'.
  EXPECT_NEAR(moved_light(std::vector{moments_of(wall), moments_of(thing)}, kFirst, 1), 32. * 32 / 4, 1e-2);
}

TEST(MovedLight, IsOfTheTrialThatEachNodeHasChosen) {
  const std::vector<Moments> trials{moments_of(wall), moments_of(thing), moments_of(thing)};
  std::vector<uint8_t> chosen(kFirst);
  for (int y = 0; y < kRows; y++)
    for (int x = 0; x < kColumns; x++) chosen[static_cast<size_t>(y) * kColumns + x] = thing(x, y) < 100 ? 1 : 0;
  EXPECT_NEAR(moved_light(trials, chosen, 2), 0, 1e-6);
}

TEST(MovedLight, NodesThatAreNotWhollySeenDoNotCount) {
  const Moments half = moments_of(wall, 0.5);
  EXPECT_EQ(moved_light(std::vector{half, moments_of(thing)}, kFirst, 1), 0);
  EXPECT_EQ(moved_light(std::vector{moments_of(thing), half}, kFirst, 1), 0);
}

}  // namespace
}  // namespace lf
