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

// Computes where the pixels of row `y` fall in a neighbour's image of `width` x `height` pixels. `place` is the number
// of the pixel at the upper left, or -1 outside of the image. `across` and `down` are parts of the distance to the next
// pixel, in 1/32767, in both halves of each value.
void project_row(const PixelMapping& mapping, int y, const float* HWY_RESTRICT inverse, int n, int width, int height,
                 int32_t* HWY_RESTRICT place, int32_t* HWY_RESTRICT across, int32_t* HWY_RESTRICT down) {
  const std::array<float, 3> first = mapping.at(0, static_cast<float>(y));
  for_lanes<float>(n, [&](auto d, int i) HWY_ATTR {
    const hn::RebindToSigned<decltype(d)> di;
    const auto x = hn::Iota(d, static_cast<float>(i)), depth = hn::LoadU(d, inverse + i);
    const auto coordinate = [&](int k) HWY_ATTR {
      return hn::Add(hn::Add(hn::Set(d, first[k]), hn::Mul(x, hn::Set(d, mapping.rows[k][0]))),
                     hn::Mul(depth, hn::Set(d, mapping.parallax[k])));
    };
    const auto z = coordinate(2), scale = hn::Div(hn::Set(d, 1.f), z), zero = hn::Zero(d);
    const auto at_x = hn::Mul(coordinate(0), scale), at_y = hn::Mul(coordinate(1), scale);
    const auto is_inside = hn::And(hn::And(hn::Gt(z, zero), hn::And(hn::Ge(at_x, zero), hn::Ge(at_y, zero))),
                                   hn::And(hn::Lt(at_x, hn::Set(d, static_cast<float>(width - 1))),
                                           hn::Lt(at_y, hn::Set(d, static_cast<float>(height - 1)))));
    const auto column = hn::ConvertTo(di, hn::IfThenElseZero(is_inside, at_x));
    const auto row = hn::ConvertTo(di, hn::IfThenElseZero(is_inside, at_y));
    const auto part = [&](auto position, auto whole) HWY_ATTR {
      const auto beyond = hn::Sub(hn::IfThenElseZero(is_inside, position), hn::ConvertTo(d, whole));
      const auto fraction = hn::ConvertTo(di, hn::Mul(hn::Set(d, 32767.f), beyond));
      return hn::Or(fraction, hn::ShiftLeft<16>(fraction));
    };
    const auto pixel = hn::Add(hn::Mul(row, hn::Set(di, width)), column);
    hn::StoreU(hn::IfThenElse(hn::RebindMask(di, is_inside), pixel, hn::Set(di, -1)), di, place + i);
    hn::StoreU(part(at_x, column), di, across + i);
    hn::StoreU(part(at_y, row), di, down + i);
  });
}

constexpr int kMaxSum = static_cast<int>(2 * MatchingImage::kUnit * MatchingCost::kMax);
constexpr float kPerSum = 0.5f / MatchingImage::kUnit;
// Truncation of the differences of luma, dx and dy, for two pixels. Unseen pixels get the largest cost.
constexpr auto kLumaLimit = static_cast<int16_t>(MatchingImage::kUnit * MatchingCost::kMaxLuma);
constexpr auto kGradientLimit = static_cast<int16_t>(MatchingImage::kUnit * MatchingCost::kMaxGradient);
alignas(16) constexpr int16_t kLimits[8] = {kLumaLimit, kGradientLimit, kGradientLimit, kMaxSum,
                                            kLumaLimit, kGradientLimit, kGradientLimit, kMaxSum};
alignas(16) constexpr int16_t kCompared[8] = {-1, -1, -1, 0, -1, -1, -1, 0};
// Stands for the pixels outside of an image.
alignas(16) constexpr int16_t kOutside[8] = {0, 0, 0, MatchingImage::kUnseen, 0, 0, 0, MatchingImage::kUnseen};

// Returns the cost of a pixel, from the bilinear mean of the two pixels at `upper` and the two at `lower`.
float cost_of_pixel(const MatchingImage::Pixel& pixel, const int16_t* upper, const int16_t* lower, int across,
                    int down) {
  const auto between = [](int a, int b, int part) { return a + (((b - a) * part + (1 << 14)) >> 15); };
  int sum = 0;
  for (int k = 0; k < 4; k++) {
    const int sample = between(between(upper[k], lower[k], down), between(upper[4 + k], lower[4 + k], down), across);
    sum += std::min(std::abs(sample - (pixel[k] & kCompared[k])), static_cast<int>(kLimits[k]));
  }
  return static_cast<float>(std::min(sum, kMaxSum)) * kPerSum;
}

// Compares the pixels of a row with a neighbour's image at the places of project_row().
void compare_row(const MatchingImage::Pixel* pixels, const MatchingImage& to, const int32_t* HWY_RESTRICT place,
                 const int32_t* HWY_RESTRICT across, const int32_t* HWY_RESTRICT down, int n,
                 float* HWY_RESTRICT cost) {
  const int16_t* const first = to.pixels.front().data();
  const ptrdiff_t row = 4 * static_cast<ptrdiff_t>(to.width);
  const auto upper_of = [&](int i) { return place[i] < 0 ? kOutside : first + 4 * static_cast<ptrdiff_t>(place[i]); };
  const auto lower_of = [&](int i) { return place[i] < 0 ? kOutside : upper_of(i) + row; };
  int i = 0;
#if HWY_TARGET != HWY_SCALAR
  const hn::FixedTag<int16_t, 8> d;
  const hn::FixedTag<int64_t, 2> d64;
  const hn::FixedTag<int32_t, 4> d32;
  const hn::FixedTag<float, 4> df;
  const auto between = [&](auto a, auto b, auto part)
                           HWY_ATTR { return hn::Add(a, hn::MulFixedPoint15(hn::Sub(b, a), part)); };
  // The mean of the upper and lower pixels at i, on the left and on the right.
  const auto column = [&](int k) HWY_ATTR {
    return hn::BitCast(
        d64, between(hn::LoadU(d, upper_of(k)), hn::LoadU(d, lower_of(k)), hn::BitCast(d, hn::Set(d32, down[k]))));
  };
  // The sums of the differences of two pixels, each in two parts, in the lower halves of the values.
  const auto sums = [&](int k, auto parts) HWY_ATTR {
    const auto a = column(k), b = column(k + 1);
    const auto sample = between(hn::BitCast(d, hn::InterleaveLower(d64, a, b)),
                                hn::BitCast(d, hn::InterleaveUpper(d64, a, b)), hn::BitCast(d, parts));
    const auto compared = hn::And(hn::LoadU(d, pixels[k].data()), hn::Load(d, kCompared));
    const auto two = hn::BitCast(d32, hn::Min(hn::Abs(hn::Sub(sample, compared)), hn::Load(d, kLimits)));
    return hn::Add(two, hn::ShiftRight<16>(two));
  };
  for (; i + 4 <= n; i += 4) {
    const auto parts = hn::LoadU(d32, across + i);
    const auto a = sums(i, hn::InterleaveLower(d32, parts, parts));
    const auto b = sums(i + 2, hn::InterleaveUpper(d32, parts, parts));
    const auto both = hn::Add(hn::ConcatEven(d32, b, a), hn::ConcatOdd(d32, b, a));
    const auto sum = hn::Min(hn::And(both, hn::Set(d32, 0xffff)), hn::Set(d32, kMaxSum));
    hn::StoreU(hn::Mul(hn::ConvertTo(df, sum), hn::Set(df, kPerSum)), df, cost + i);
  }
#endif
  for (; i < n; i++) cost[i] = cost_of_pixel(pixels[i], upper_of(i), lower_of(i), across[i] >> 16, down[i] >> 16);
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
    : image_(image), place_(image.width), across_(image.width), down_(image.width), cost_(image.width) {
  for (const MatchingImage* neighbour : neighbours) neighbours_.push_back({neighbour, {image, *neighbour}});
  least_.assign((neighbours.size() + 1) / 2, std::vector<float>(image.width));
}

void MatchingCost::compute(std::span<const float> inverse, std::span<float> cost) {
  const int n = image_.width;
  for (int y = 0; y < image_.height; y++) {
    const size_t row = static_cast<size_t>(y) * n;
    for (std::vector<float>& least : least_) std::ranges::fill(least, kMax);
    for (const Neighbour& neighbour : neighbours_) {
      const MatchingImage& to = *neighbour.image;
      HWY_DYNAMIC_DISPATCH(project_row)
      (neighbour.mapping, y, &inverse[row], n, to.width, to.height, place_.data(), across_.data(), down_.data());
      HWY_DYNAMIC_DISPATCH(compare_row)
      (&image_.pixels[row], to, place_.data(), across_.data(), down_.data(), n, cost_.data());
      for (std::vector<float>& least : least_) HWY_DYNAMIC_DISPATCH(keep_least)(least.data(), cost_.data(), n);
    }
    std::fill_n(&cost[row], n, 0.f);
    for (const std::vector<float>& least : least_)
      HWY_DYNAMIC_DISPATCH(add_to)(least.data(), 1.f / static_cast<float>(least_.size()), n, &cost[row]);
  }
}

}  // namespace lf
#endif
