// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/sum_planes.h"

#include "composite/resolve.h"
#include "support/test.h"

namespace lf {
namespace {

TEST(SumRounding, MissingWeightIsExact) {
  for (int n = 0; n < 256; n++) {
    const auto lost = static_cast<uint8_t>(n);
    uint16_t wide = 0;
    add_missing_row(&wide, &lost, 1);
    EXPECT_EQ(wide, std::lround(n * 32768 / 255.)) << n;
    EXPECT_EQ(round_missing(wide), n);
  }
}

TEST(SumRounding, RoundsToNearestWithHalvesUp) {
  for (int sum = INT16_MIN; sum <= INT16_MAX; sum++) {
    const auto in = static_cast<int16_t>(sum);
    const int nearest = static_cast<int>(std::floor(sum / 128. + 0.5));
    uint8_t luma, chroma, centred;
    round_row(&luma, &in, 1);
    round_chroma_row(&chroma, &in, 1, 0);
    round_chroma_row(&centred, &in, 1, 128);
    ASSERT_EQ(luma, std::clamp(nearest, 0, 255)) << sum;
    ASSERT_EQ(static_cast<int8_t>(chroma), std::clamp(nearest, -128, 127)) << sum;
    ASSERT_EQ(centred, std::clamp(nearest, -128, 127) + 128) << sum;
  }
}

TEST(SumRounding, FragmentsRoundTripThroughSums) {
  const Rect rect{2, 4, 5, 7};
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420}) {
    std::vector<int16_t> samples(packed_size(family, 3, 3));
    std::vector<uint16_t> lost(9, 0);
    for (size_t i = 0; i < samples.size(); i++) samples[i] = static_cast<int16_t>(128 * i + 63);
    const auto sums = packed_sums<const int16_t, const uint16_t>(family, rect, samples.data(), lost.data());
    Fragment f = rounded_fragment(sums);
    EXPECT_EQ(f.rect, rect);
    EXPECT_TRUE(f.lost.empty());
    for (size_t i = 0; i < f.pixels.size(); i++)
      EXPECT_EQ(f.pixels[i], family == PixelFamily::kRgb ? i / 3 + 9 * (i % 3) : i);
    lost[5] = 32768;
    f = rounded_fragment(sums);
    ASSERT_EQ(f.lost.size(), 9u);
    EXPECT_EQ(f.lost[5], 255);
  }
}

}  // namespace
}  // namespace lf
