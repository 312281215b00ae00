// SPDX-License-Identifier: LGPL-2.1-or-later
#include "depth/matching_cost.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "depth/matching_cost.cc"
#include <hwy/foreach_target.h>  // must precede highway.h
#include <hwy/highway.h>

#include "base/for_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lf::HWY_NAMESPACE {

// Computes where the pixels of row `y` fall in a neighbour's image. Points behind the neighbour get a negative x.
void project_row(const PixelMapping& mapping, int y, const float* HWY_RESTRICT inverse, int n, float* HWY_RESTRICT to_x,
                 float* HWY_RESTRICT to_y) {
  const std::array<float, 3> first = mapping.at(0, static_cast<float>(y));
  for_lanes<float>(n, [&](auto d, int i) HWY_ATTR {
    const auto x = hn::Iota(d, static_cast<float>(i)), depth = hn::LoadU(d, inverse + i);
    const auto coordinate = [&](int k) HWY_ATTR {
      return hn::Add(hn::Add(hn::Set(d, first[k]), hn::Mul(x, hn::Set(d, mapping.rows[k][0]))),
                     hn::Mul(depth, hn::Set(d, mapping.parallax[k])));
    };
    const auto z = coordinate(2), scale = hn::Div(hn::Set(d, 1.f), z);
    const auto is_in_front = hn::Gt(z, hn::Zero(d));
    hn::StoreU(hn::IfThenElse(is_in_front, hn::Mul(coordinate(0), scale), hn::Set(d, -1.f)), d, to_x + i);
    hn::StoreU(hn::IfThenElse(is_in_front, hn::Mul(coordinate(1), scale), hn::Set(d, -1.f)), d, to_y + i);
  });
}

constexpr auto kMaxSum = static_cast<uint64_t>(2 * MatchingImage::kUnit * MatchingCost::kMax);
// Truncation of the differences of luma, dx and dy. Unseen pixels get the largest cost.
alignas(8) constexpr int16_t kLimits[4] = {static_cast<int16_t>(MatchingImage::kUnit * MatchingCost::kMaxLuma),
                                           static_cast<int16_t>(MatchingImage::kUnit* MatchingCost::kMaxGradient),
                                           static_cast<int16_t>(MatchingImage::kUnit* MatchingCost::kMaxGradient),
                                           static_cast<int16_t>(kMaxSum)};
alignas(8) constexpr int16_t kCompared[4] = {-1, -1, -1, 0};

// Returns the sum of the truncated differences between a pixel and the bilinear mean of the four pixels at `upper` and
// `lower`. `across` and `down` are parts of the distance to the next pixel, in 1/32768.
#if HWY_TARGET == HWY_SCALAR
uint64_t sum_of_differences(const MatchingImage::Pixel& pixel, const int16_t* upper, const int16_t* lower,
                            int16_t across, int16_t down) {
  const auto between = [](int a, int b, int part) { return a + (((b - a) * part + (1 << 14)) >> 15); };
  uint64_t sum = 0;
  for (int k = 0; k < 4; k++) {
    const int sample = between(between(upper[k], lower[k], down), between(upper[4 + k], lower[4 + k], down), across);
    sum += static_cast<uint64_t>(std::min(std::abs(sample - (pixel[k] & kCompared[k])), static_cast<int>(kLimits[k])));
  }
  return sum;
}
#else
HWY_INLINE uint64_t sum_of_differences(const MatchingImage::Pixel& pixel, const int16_t* upper, const int16_t* lower,
                                       int16_t across, int16_t down) {
  const hn::FixedTag<int16_t, 8> two;
  const hn::FixedTag<int16_t, 4> one;
  const hn::FixedTag<uint64_t, 1> bits;
  const auto above = hn::LoadU(two, upper), below = hn::LoadU(two, lower);
  const auto both = hn::Add(above, hn::MulFixedPoint15(hn::Sub(below, above), hn::Set(two, down)));
  const auto first = hn::LowerHalf(one, both), second = hn::UpperHalf(one, both);
  const auto sample = hn::Add(first, hn::MulFixedPoint15(hn::Sub(second, first), hn::Set(one, across)));
  const auto compared = hn::And(hn::LoadU(one, pixel.data()), hn::Load(one, kCompared));
  const auto difference = hn::Min(hn::Abs(hn::Sub(sample, compared)), hn::Load(one, kLimits));
  // The product adds the four 16-bit lanes in its upper 16 bits.
  return hn::GetLane(hn::BitCast(bits, difference)) * 0x0001000100010001u >> 48;
}
#endif

// Compares the pixels of a row with the neighbour's image at (x[i], y[i]).
void compare_row(const MatchingImage::Pixel* pixels, const MatchingImage& to, const float* x, const float* y, int n,
                 float* HWY_RESTRICT cost) {
  const float right = static_cast<float>(to.width - 1), bottom = static_cast<float>(to.height - 1);
  for (int i = 0; i < n; i++) {
    if (!(x[i] >= 0 && y[i] >= 0 && x[i] < right && y[i] < bottom)) {
      cost[i] = MatchingCost::kMax;
      continue;
    }
    const int column = static_cast<int>(x[i]), row = static_cast<int>(y[i]);
    const auto across = static_cast<int16_t>(32767.f * (x[i] - static_cast<float>(column)));
    const auto down = static_cast<int16_t>(32767.f * (y[i] - static_cast<float>(row)));
    const int16_t* const at = to.pixels[static_cast<size_t>(row) * to.width + column].data();
    const uint64_t sum = sum_of_differences(pixels[i], at, at + 4 * static_cast<ptrdiff_t>(to.width), across, down);
    cost[i] = static_cast<float>(std::min(sum, kMaxSum)) * (0.5f / MatchingImage::kUnit);
  }
}

// Swaps values so that least[i] <= rest[i].
void keep_least(float* HWY_RESTRICT least, float* HWY_RESTRICT rest, int n) {
  for_lanes<float>(n, [&](auto d, int i) HWY_ATTR {
    const auto a = hn::LoadU(d, least + i), b = hn::LoadU(d, rest + i);
    hn::StoreU(hn::Min(a, b), d, least + i);
    hn::StoreU(hn::Max(a, b), d, rest + i);
  });
}

void add_to(const float* HWY_RESTRICT values, float scale, int n, float* HWY_RESTRICT sum) {
  for_lanes<float>(n, [&](auto d, int i) HWY_ATTR {
    hn::StoreU(hn::Add(hn::LoadU(d, sum + i), hn::Mul(hn::LoadU(d, values + i), hn::Set(d, scale))), d, sum + i);
  });
}

}  // namespace lf::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lf {

HWY_EXPORT(project_row);
HWY_EXPORT(compare_row);
HWY_EXPORT(keep_least);
HWY_EXPORT(add_to);

MatchingCost::MatchingCost(const MatchingImage& image, std::span<const MatchingImage* const> neighbours)
    : image_(image), x_(image.width), y_(image.width), cost_(image.width) {
  for (const MatchingImage* neighbour : neighbours) neighbours_.push_back({neighbour, {image, *neighbour}});
  least_.assign((neighbours.size() + 1) / 2, std::vector<float>(image.width));
}

void MatchingCost::compute(std::span<const float> inverse, std::span<float> cost) {
  const int n = image_.width;
  for (int y = 0; y < image_.height; y++) {
    const size_t row = static_cast<size_t>(y) * n;
    for (std::vector<float>& least : least_) std::ranges::fill(least, kMax);
    for (const Neighbour& neighbour : neighbours_) {
      HWY_DYNAMIC_DISPATCH(project_row)(neighbour.mapping, y, &inverse[row], n, x_.data(), y_.data());
      HWY_DYNAMIC_DISPATCH(compare_row)(&image_.pixels[row], *neighbour.image, x_.data(), y_.data(), n, cost_.data());
      for (std::vector<float>& least : least_) HWY_DYNAMIC_DISPATCH(keep_least)(least.data(), cost_.data(), n);
    }
    std::fill_n(&cost[row], n, 0.f);
    for (const std::vector<float>& least : least_)
      HWY_DYNAMIC_DISPATCH(add_to)(least.data(), 1.f / static_cast<float>(least_.size()), n, &cost[row]);
  }
}

}  // namespace lf
#endif
