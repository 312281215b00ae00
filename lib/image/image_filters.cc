// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/image_filters.h"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "image/image_filters.cc"
#include <hwy/foreach_target.h>  // must precede highway.h
#include <hwy/highway.h>

#include "base/for_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lf::HWY_NAMESPACE {

// Factors have 14 fraction bits and values 7, so the upper 16 bits of the product have 5.
constexpr int kValueBits = 7, kLeftBits = 5;

// `zero` is the neutral value. `from` and `to` may be equal.
void divide_row(const uint8_t* from, int n, int factor, int zero, uint8_t* to) {
  for_lanes<int16_t>(n, [&](auto d, int i) HWY_ATTR {
    const hn::Rebind<uint8_t, decltype(d)> d8;
    const auto none = hn::Set(d, static_cast<int16_t>(zero));
    const auto value = hn::ShiftLeft<kValueBits>(hn::Sub(hn::PromoteTo(d, hn::LoadU(d8, from + i)), none));
    const auto product =
        hn::Add(hn::MulHigh(value, hn::Set(d, static_cast<int16_t>(factor))), hn::Set(d, 1 << (kLeftBits - 1)));
    hn::StoreU(hn::DemoteTo(d8, hn::Add(hn::ShiftRight<kLeftBits>(product), none)), d8, to + i);
  });
}

// Computes v + (kSharpening / 4) (4 v - a - b - c - d), in 16 bits.
constexpr int kFractionBits = kSharpeningBits;
constexpr int16_t kNeighbour = kSharpeningFactor;

HWY_INLINE uint8_t sharpened(int v, int a, int b, int c, int d) {
  const int out = v + ((kNeighbour * (4 * v - (a + b + c + d)) + (1 << (kFractionBits - 1))) >> kFractionBits);
  return static_cast<uint8_t>(out < 0 ? 0 : out > 255 ? 255 : out);
}

struct PlaneRows {
  const uint8_t* from;
  ptrdiff_t stride;
  int step, y0, y1, height;  // step: bytes per pixel
  uint8_t* to;
};

// Filters `n` bytes of each row from byte `first` on, which must all have neighbours on both sides. Goes from top to
// bottom, so that shared rows stay in registers.
HWY_INLINE void inner(const PlaneRows& plane, int first, int n) {
  map_lanes<int16_t>(n, [&](auto d, int i) HWY_ATTR {
    const hn::Rebind<uint8_t, decltype(d)> d8;
    const ptrdiff_t begin = plane.y0 * plane.stride + first + i;
    const uint8_t* HWY_RESTRICT row = plane.from + begin;
    uint8_t* HWY_RESTRICT out = plane.to + begin;
    const auto at = [&](const uint8_t* from) HWY_ATTR { return hn::PromoteTo(d, hn::LoadU(d8, from)); };
    auto v = at(row), above = plane.y0 > 0 ? at(row - plane.stride) : v;
    for (int y = plane.y0; y < plane.y1; y++, row += plane.stride, out += plane.stride) {
      const auto below = at(y + 1 < plane.height ? row + plane.stride : row);
      const auto around = hn::Add(hn::Add(at(row - plane.step), at(row + plane.step)), hn::Add(above, below));
      const auto difference = hn::Sub(hn::ShiftLeft<2>(v), around);
      // Computes (a b + 2^14) >> 15.
      const auto more = hn::MulFixedPoint15(difference, hn::Set(d, kNeighbour << (15 - kFractionBits)));
      hn::StoreU(hn::DemoteTo(d8, hn::Add(v, more)), d8, out);
      above = v;
      v = below;
    }
  });
}

void plane(const uint8_t* from, ptrdiff_t stride, int step, int width, int height, const Rect& rect, uint8_t* to) {
  const int first = rect.x0 > 0 ? rect.x0 : 1, last = rect.x1 < width ? rect.x1 : width - 1;
  if (last > first) inner({from, stride, step, rect.y0, rect.y1, height, to}, first * step, (last - first) * step);
  if (first == rect.x0 && last == rect.x1) return;
  for (int y = rect.y0; y < rect.y1; y++) {
    const uint8_t* const row = from + y * stride;
    const uint8_t* const above = y > 0 ? row - stride : row;
    const uint8_t* const below = y + 1 < height ? row + stride : row;
    uint8_t* const out = to + y * stride;
    const auto border = [&](int x) {
      const int left = x > 0 ? step : 0, right = x + 1 < width ? step : 0;
      for (int i = x * step; i < (x + 1) * step; i++)
        out[i] = sharpened(row[i], row[i - left], row[i + right], above[i], below[i]);
    };
    if (rect.x0 == 0) border(0);
    if (rect.x1 == width && width > 1) border(width - 1);
  }
}

}  // namespace lf::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lf {

HWY_EXPORT(divide_row);

int gain_factor(float gain) { return static_cast<int>(std::clamp<long>(std::lround((1 << 14) / gain), 0, 32767)); }

ImageView divide_by_gain(const ImageView& image, const Rect& rect, float gain, ByteBuffer& memory) {
  const int factor = gain_factor(gain);
  return write_copy(image, rect, memory, [factor](const PlaneCopy& plane) {
    for (int y = plane.part.y0; y < plane.part.y1; y++) {
      const ptrdiff_t at = y * plane.stride + ptrdiff_t{plane.part.x0} * plane.step;
      HWY_DYNAMIC_DISPATCH(divide_row)
      (plane.from + at, plane.part.width() * plane.step, factor, plane.index == 0 ? 0 : 128, plane.to + at);
    }
  });
}

void divide_by_gain(std::span<uint8_t> luma, float gain) {
  HWY_DYNAMIC_DISPATCH(divide_row)(luma.data(), static_cast<int>(luma.size()), gain_factor(gain), 0, luma.data());
}

HWY_EXPORT(plane);

ImageView sharpen(const ImageView& image, const Rect& rect, ByteBuffer& memory) {
  return write_copy(image, rect, memory, [](const PlaneCopy& p) {
    HWY_DYNAMIC_DISPATCH(plane)(p.from, p.stride, p.step, p.width, p.height, p.part, p.to);
  });
}

Image sharpened(const Image& image) {
  ByteBuffer memory;
  sharpen(image.view(), {0, 0, image.width(), image.height()}, memory);
  Image out(image.family(), image.width(), image.height());
  std::ranges::copy(memory, out.data().begin());
  return out;
}

}  // namespace lf
#endif
