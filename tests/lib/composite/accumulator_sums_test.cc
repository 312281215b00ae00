// SPDX-License-Identifier: LGPL-2.1-or-later
// What Accumulator does with sums in 16 bits, alone and beside fragments in 8.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "composite/accumulator.h"
#include "support/plain_fragments.h"
#include "support/rounded_sum.h"

namespace lf::test {
namespace {

// A sum in 16 bits in its own memory.
struct Sums {
  Sums(PixelFamily family, const Rect& rect, bool with_lost)
      : samples(packed_size(family, rect.width(), rect.height())), lost(with_lost ? area(rect) : 0) {
    planes = packed_sums(family, rect, samples.data(), with_lost ? lost.data() : nullptr);
  }
  ConstSumPlanes view() const {
    return packed_sums<const int16_t, const uint16_t>(planes.family, planes.rect, samples.data(),
                                                      lost.empty() ? nullptr : lost.data());
  }
  std::vector<int16_t> samples;
  std::vector<uint16_t> lost;
  SumPlanes planes;
};

Sums random_sums(PixelFamily family, const Rect& rect, std::mt19937& random, int most, bool lost) {
  Sums out(family, rect, lost);
  const size_t signed_from = family == PixelFamily::kI420 ? area(rect) : out.samples.size();
  for (size_t i = 0; i < out.samples.size(); i++)
    out.samples[i] = static_cast<int16_t>(static_cast<int>(random() % (most + 1)) - (i >= signed_from ? most / 2 : 0));
  for (uint16_t& v : out.lost) v = static_cast<uint16_t>(random() % 3 ? 0 : random() % (most + 1));
  return out;
}

TEST(AccumulatorSums, SixteenBitsAreExactUntilThePictureIsRounded) {
  // Contributions in double precision, rounded to 1/128 of a level each: their sum is within n halves of that.
  std::mt19937 random(21);
  const int kCount = 8, w = 37, h = 19;
  for (const PixelFamily family : kFamilies) {
    std::vector<double> exact(packed_size(family, w, h));
    Accumulator sum;
    sum.reset(family, w, h);
    for (int i = 0; i < kCount; i++) {
      Sums part(family, {0, 0, w, h}, false);
      for (size_t k = 0; k < exact.size(); k++) {
        const double v = (random() % 1000000) / 1e6 * 255 / kCount;
        exact[k] += v;
        part.samples[k] = static_cast<int16_t>(std::lround(v * 128));
      }
      ASSERT_TRUE(sum.add(part.view()));
    }
    const std::optional<ConstSumPlanes> sums = sum.sums();
    ASSERT_TRUE(sums.has_value());
    for (size_t k = 0; k < exact.size(); k++)  // planes of the whole picture lie one after the other
      ASSERT_NEAR(sums->plane[0][k] / 128., exact[k], kCount * 0.5 / 128);
    const Image image = sum.resolve();
    for (int y = 0; y < h; y++)
      for (int x = 0; x < w; x++) {
        const size_t k = static_cast<size_t>(y) * w + x;
        const int value = family == PixelFamily::kRgb ? image.pixel(x, y)[0] : image.plane(0)[k];
        ASSERT_NEAR(value, exact[k], 0.5 + kCount * 0.5 / 128);
      }
  }
}

TEST(AccumulatorSums, EightAndSixteenBitsInAnyOrder) {
  std::mt19937 random(22);
  for (const PixelFamily family : kFamilies) {
    std::vector<Fragment> fragments;
    std::vector<Sums> sums;
    for (int i = 0; i < 6; i++) {
      const bool lost = i % 2;
      fragments.push_back(random_fragment(family, 41, 23, random, 20, lost));
      sums.push_back(random_sums(family, random_fragment(family, 41, 23, random, 0, false).rect, random, 2000, lost));
    }
    std::vector<int> order(12);
    for (int i = 0; i < 12; i++) order[i] = i;
    std::vector<uint8_t> first;
    for (int round = 0; round < 6; round++) {
      Accumulator sum;
      sum.reset(family, 41, 23);
      for (const int i : order) ASSERT_TRUE(i < 6 ? sum.add(fragments[i]) : sum.add(sums[i - 6].view()));
      const Image image = sum.resolve({5, 6, 7});
      if (round == 0) first = image.data();
      EXPECT_EQ(image.data(), first);
      std::shuffle(order.begin(), order.end(), random);
    }
  }
}

TEST(AccumulatorSums, EightBitFragmentsAreSumsWithoutFraction) {
  std::mt19937 random(23);
  for (const PixelFamily family : kFamilies) {
    const Fragment f = random_fragment(family, 33, 21, random, 255, true);
    Accumulator eight, sixteen;
    eight.reset(family, 33, 21);
    sixteen.reset(family, 33, 21);
    ASSERT_TRUE(eight.add(f));
    ASSERT_TRUE(sixteen.add(*eight.sums()));
    EXPECT_EQ(eight.sums()->rect, f.rect);
    EXPECT_EQ(*test::rounded_sum(sixteen), f);
  }
}

TEST(AccumulatorSums, KeptSumsAreTheSamePictureWithoutACopy) {
  std::mt19937 random(24);
  for (const PixelFamily family : kFamilies)
    for (const bool lost : {false, true}) {
      const Rect all{0, 0, 31, 18};
      const Sums whole = random_sums(family, all, random, 20000, lost);
      const Fragment more = random_fragment(family, 31, 18, random, 60, true);
      Accumulator kept, copied;
      for (Accumulator* sum : {&kept, &copied}) sum->reset(family, 31, 18);
      ASSERT_TRUE(kept.add_kept(whole.view()));
      ASSERT_TRUE(copied.add(whole.view()));
      EXPECT_EQ(kept.sums()->plane[0], whole.samples.data());
      EXPECT_NE(copied.sums()->plane[0], whole.samples.data());
      EXPECT_EQ(kept.resolve({1, 2, 3}).data(), copied.resolve({1, 2, 3}).data());
      for (Accumulator* sum : {&kept, &copied}) {
        ASSERT_TRUE(sum->add(more));
        ASSERT_TRUE(sum->add_kept(whole.view()));  // not the only ones any more: added
        ASSERT_TRUE(sum->add_lost_weights({3, 3, 5, 4}, {0.25f, 1.f}));
      }
      EXPECT_NE(kept.sums()->plane[0], whole.samples.data());
      EXPECT_EQ(kept.resolve({1, 2, 3}).data(), copied.resolve({1, 2, 3}).data());
      EXPECT_FALSE(kept.add_kept(random_sums(family, {0, 0, 32, 18}, random, 9, false).view()));
    }
}

TEST(AccumulatorSums, HostileSumsSaturate) {
  for (const PixelFamily family : kFamilies)
    for (const int16_t value : {int16_t{INT16_MAX}, int16_t{INT16_MIN}}) {
      Sums extreme(family, {0, 0, 4, 4}, true);
      std::ranges::fill(extreme.samples, value);
      std::ranges::fill(extreme.lost, uint16_t{20000});
      Accumulator sum;
      sum.reset(family, 4, 4);
      for (int i = 0; i < 5; i++) ASSERT_TRUE(sum.add(extreme.view()));
      EXPECT_EQ(sum.sums()->plane[0][0], value);
      EXPECT_EQ(sum.sums()->plane[1][0], value);
      EXPECT_EQ(sum.sums()->lost[3], UINT16_MAX);
      EXPECT_EQ(sum.resolve({9, 9, 9}).data()[0], 9);  // more than everything is lost
    }
}

}  // namespace
}  // namespace lf::test
