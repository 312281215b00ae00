// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/boxed_luma.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "focus/boxed_luma.cc"
#include <hwy/foreach_target.h>  // has to precede highway.h
#include <hwy/highway.h>

#include "base/for_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lf::HWY_NAMESPACE {

// Full-range BT.601, in 8 bits of fraction.
template <class D16, class V8>
HWY_INLINE auto luma_of(D16 d16, V8 r, V8 g, V8 b) {
  const auto part = [&](V8 v, uint16_t of) { return hn::Mul(hn::PromoteTo(d16, v), hn::Set(d16, of)); };
  const auto sum = hn::Add(hn::Add(part(r, 77), part(g, 150)), hn::Add(part(b, 29), hn::Set(d16, 128)));
  return hn::ShiftRight<8>(sum);
}

// Of values up to 255.
template <class D16, class V16>
HWY_INLINE auto to_bytes(D16 /*d16*/, V16 v) {
  return hn::DemoteTo(hn::Rebind<uint8_t, D16>(), hn::BitCast(hn::RebindToSigned<D16>(), v));
}

// kStride: channels of a pixel.
template <int kStride>
HWY_INLINE void luma_row(const uint8_t* HWY_RESTRICT pixel, const RgbLayout& at, int n, uint8_t* HWY_RESTRICT out) {
  map_lanes<uint16_t>(n, [&](auto d16, int i) HWY_ATTR {
    const hn::Rebind<uint8_t, decltype(d16)> d8;
    auto v0 = hn::Zero(d8), v1 = v0, v2 = v0, v3 = v0;
    if constexpr (kStride == 3)
      hn::LoadInterleaved3(d8, pixel + ptrdiff_t{3} * i, v0, v1, v2);
    else
      hn::LoadInterleaved4(d8, pixel + ptrdiff_t{4} * i, v0, v1, v2, v3);
    const auto channel = [&](int c) HWY_ATTR { return c == 0 ? v0 : c == 1 ? v1 : c == 2 ? v2 : v3; };
    hn::StoreU(to_bytes(d16, luma_of(d16, channel(at.r), channel(at.g), channel(at.b))), d8, out + i);
  });
}

void rgb_luma_row(const uint8_t* HWY_RESTRICT pixel, const RgbLayout& at, int n, uint8_t* HWY_RESTRICT out) {
  if (at.pixel_stride == 3) return luma_row<3>(pixel, at, n, out);
  if (at.pixel_stride == 4) return luma_row<4>(pixel, at, n, out);
  for (int i = 0; i < n; i++, pixel += at.pixel_stride)
    out[i] = static_cast<uint8_t>((77 * pixel[at.r] + 150 * pixel[at.g] + 29 * pixel[at.b] + 128) >> 8);
}

// Sums of kTrialBox neighbours: n of n + kTrialBox - 1.
void sums_along(const uint8_t* HWY_RESTRICT luma, int n, uint16_t* HWY_RESTRICT out) {
  static_assert(kTrialBox == 4);
  map_lanes<uint16_t>(n, [&](auto d16, int i) HWY_ATTR {
    const hn::Rebind<uint8_t, decltype(d16)> d8;
    const auto at = [&](int k) HWY_ATTR { return hn::PromoteTo(d16, hn::LoadU(d8, luma + i + k)); };
    hn::StoreU(hn::Add(hn::Add(at(0), at(1)), hn::Add(at(2), at(3))), d16, out + i);
  });
}

void means_of(const uint16_t* const row[kTrialBox], int n, uint8_t* HWY_RESTRICT out) {
  map_lanes<uint16_t>(n, [&](auto d16, int i) HWY_ATTR {
    const hn::Rebind<uint8_t, decltype(d16)> d8;
    const auto at = [&](int k) HWY_ATTR { return hn::LoadU(d16, row[k] + i); };
    const auto sum = hn::Add(hn::Add(at(0), at(1)), hn::Add(at(2), at(3)));
    hn::StoreU(to_bytes(d16, hn::ShiftRight<4>(hn::Add(sum, hn::Set(d16, 8)))), d8, out + i);
  });
}

}  // namespace lf::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lf {
namespace {

HWY_EXPORT(rgb_luma_row);
HWY_EXPORT(sums_along);
HWY_EXPORT(means_of);

// Luma of pixels [x0, x1) of a row.
void read_luma(const ImageView& image, int y, int x0, int x1, uint8_t* out) {
  const uint8_t* const row = image.plane[0] + y * image.stride[0];
  if (image.family == PixelFamily::kI420) {
    std::copy_n(row + x0, x1 - x0, out);
    return;
  }
  HWY_DYNAMIC_DISPATCH(rgb_luma_row)(row + ptrdiff_t{x0} * image.layout.pixel_stride, image.layout, x1 - x0, out);
}

}  // namespace

void box_luma(const ImageView& image, const Rect& rect, BoxedLuma& out) {
  const int width = rect.width(), height = rect.height();
  out.rect = rect;
  out.values.resize(static_cast<size_t>(width) * (height + 1) + BoxedLuma::kSpare);
  constexpr int kBefore = kTrialBox / 2 - 1;
  const int x0 = std::max(rect.x0 - kBefore, 0), x1 = std::min(rect.x1 + kTrialBox - kBefore - 1, image.width);
  thread_local std::vector<uint8_t> luma;
  thread_local std::vector<uint16_t> sums;  // along the last kTrialBox rows, round robin
  luma.resize(static_cast<size_t>(width) + kTrialBox - 1);
  sums.resize(static_cast<size_t>(width) * kTrialBox);
  const auto sums_of = [&](int y) { return sums.data() + static_cast<size_t>(y % kTrialBox) * width; };
  int made = -1;  // the last row that `sums` has
  for (int y = 0; y < height; y++) {
    const int first = rect.y0 + y - kBefore;
    const int last = std::min(first + kTrialBox - 1, image.height - 1);
    for (made = std::max(made, std::max(first, 0) - 1); made < last;) {
      made++;
      uint8_t* const inside = luma.data() + (x0 - (rect.x0 - kBefore));
      read_luma(image, made, x0, x1, inside);
      std::fill(luma.data(), inside, *inside);
      std::fill(inside + (x1 - x0), luma.data() + luma.size(), inside[x1 - x0 - 1]);
      HWY_DYNAMIC_DISPATCH(sums_along)(luma.data(), width, sums_of(made));
    }
    const uint16_t* rows[kTrialBox];
    for (int k = 0; k < kTrialBox; k++) rows[k] = sums_of(std::clamp(first + k, 0, image.height - 1));
    HWY_DYNAMIC_DISPATCH(means_of)(rows, width, out.values.data() + static_cast<size_t>(y) * width);
  }
}

}  // namespace lf
#endif
