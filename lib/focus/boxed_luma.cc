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

HWY_INLINE void rgb_luma_row(const uint8_t* HWY_RESTRICT pixel, const RgbLayout& at, int n, uint8_t* HWY_RESTRICT out) {
  if (at.pixel_stride == 3) return luma_row<3>(pixel, at, n, out);
  if (at.pixel_stride == 4) return luma_row<4>(pixel, at, n, out);
  for (int i = 0; i < n; i++, pixel += at.pixel_stride)
    out[i] = static_cast<uint8_t>((77 * pixel[at.r] + 150 * pixel[at.g] + 29 * pixel[at.b] + 128) >> 8);
}

// Sums of kTrialBox neighbours: n of n + kTrialBox - 1.
HWY_INLINE void sums_along(const uint8_t* HWY_RESTRICT luma, int n, uint16_t* HWY_RESTRICT out) {
  static_assert(kTrialBox == 4);
  map_lanes<uint16_t>(n, [&](auto d16, int i) HWY_ATTR {
    const hn::Rebind<uint8_t, decltype(d16)> d8;
    const auto at = [&](int k) HWY_ATTR { return hn::PromoteTo(d16, hn::LoadU(d8, luma + i + k)); };
    hn::StoreU(hn::Add(hn::Add(at(0), at(1)), hn::Add(at(2), at(3))), d16, out + i);
  });
}

// A row of values from its rows' sums, and the row above, of which `above` are the values, with these in its upper
// bytes (if `out` is not null).
HWY_INLINE void means_of(const uint16_t* const row[kTrialBox], int n, const uint16_t* HWY_RESTRICT above,
                         uint16_t* HWY_RESTRICT values, uint16_t* HWY_RESTRICT out) {
  map_lanes<uint16_t>(n, [&](auto d, int i) HWY_ATTR {
    const auto at = [&](int k) HWY_ATTR { return hn::LoadU(d, row[k] + i); };
    const auto sum = hn::Add(hn::Add(at(0), at(1)), hn::Add(at(2), at(3)));
    const auto mean = hn::ShiftRight<4>(hn::Add(sum, hn::Set(d, 8)));
    hn::StoreU(mean, d, values + i);
    if (out) hn::StoreU(hn::Or(hn::LoadU(d, above + i), hn::ShiftLeft<8>(mean)), d, out + i);
  });
}

// Luma of pixels [x0, x1) of a row.
HWY_INLINE void read_luma(const ImageView& image, int y, int x0, int x1, uint8_t* out) {
  const uint8_t* const row = image.plane[0] + y * image.stride[0];
  if (image.family == PixelFamily::kI420)
    std::copy_n(row + x0, x1 - x0, out);
  else
    rgb_luma_row(row + ptrdiff_t{x0} * image.layout.pixel_stride, image.layout, x1 - x0, out);
}

// Of `rect`, to `out`. Scratch: `luma` has room for a row of it and kTrialBox - 1 pixels, `sums` for kTrialBox rows,
// `values` for two.
void box(const ImageView& image, const Rect& rect, uint8_t* luma, uint16_t* sums, uint16_t* values, uint16_t* out) {
  const int width = rect.width();
  constexpr int kBefore = kTrialBox / 2 - 1;
  const int begin = rect.x0 - kBefore, end = rect.x1 + kTrialBox - kBefore - 1;
  const int x0 = HWY_MAX(begin, 0), x1 = HWY_MIN(end, image.width);
  const auto sums_of = [&](int y) { return sums + static_cast<size_t>(y % kTrialBox) * width; };  // round robin
  const auto values_of = [&](int y) { return values + static_cast<size_t>(y % 2) * width; };
  const auto add_along = [&](int y) HWY_ATTR {
    if (image.family == PixelFamily::kI420 && x0 == begin && x1 == end) {
      sums_along(image.plane[0] + y * image.stride[0] + x0, width, sums_of(y));
      return;
    }
    uint8_t* const inside = luma + (x0 - begin);
    read_luma(image, y, x0, x1, inside);
    std::fill(luma, inside, *inside);
    std::fill(inside + (x1 - x0), luma + (end - begin), inside[x1 - x0 - 1]);
    sums_along(luma, width, sums_of(y));
  };
  int made = HWY_MAX(rect.y0 - kBefore, 0) - 1;  // the last row that `sums` has
  for (int y = rect.y0; y <= rect.y1; y++) {
    uint16_t* const above = y > rect.y0 ? out + static_cast<size_t>(y - 1 - rect.y0) * width : nullptr;
    const uint16_t* values_above = values_of(y + 1);
    if (y == image.height) {  // the last row is below itself
      for (int i = 0; i < width; i++) above[i] = static_cast<uint16_t>(values_above[i] * 0x101);
      break;
    }
    for (const int last = HWY_MIN(y - kBefore + kTrialBox - 1, image.height - 1); made < last;) add_along(++made);
    const uint16_t* rows[kTrialBox];
    for (int k = 0; k < kTrialBox; k++) rows[k] = sums_of(HWY_MIN(HWY_MAX(y - kBefore + k, 0), image.height - 1));
    means_of(rows, width, values_above, values_of(y), above);
  }
}

}  // namespace lf::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lf {
namespace {

HWY_EXPORT(box);

}  // namespace

void box_luma(const ImageView& image, const Rect& rect, BoxedLuma& out) {
  out.rect = rect;
  const auto width = static_cast<size_t>(rect.width());
  out.values.resize(width * rect.height() + BoxedLuma::kSpare);
  std::fill_n(out.values.end() - BoxedLuma::kSpare, BoxedLuma::kSpare, uint16_t{0});
  thread_local ByteBuffer luma;
  thread_local UninitializedVector<uint16_t> rows;
  luma.resize(width + kTrialBox - 1);
  rows.resize(width * (kTrialBox + 2));
  HWY_DYNAMIC_DISPATCH(box)
  (image, rect, luma.data(), rows.data(), rows.data() + width * kTrialBox, out.values.data());
}

}  // namespace lf
#endif
