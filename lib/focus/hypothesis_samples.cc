// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/hypothesis_samples.h"

#include <algorithm>

#include "focus/photo_consistency.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "focus/hypothesis_samples.cc"
#include <hwy/foreach_target.h>  // must precede highway.h
#include <hwy/highway.h>

#include "base/for_lanes-inl.h"

#ifndef LF_FOCUS_BOXED_LUMA_ONCE_
#define LF_FOCUS_BOXED_LUMA_ONCE_
namespace lf {
// The weights of R, G and B in luma. They are variables instead of constants, because compilers would replace the
// products by several shifts and additions.
struct LumaWeights {
  uint16_t r, g, b;
};
}  // namespace lf
#endif

HWY_BEFORE_NAMESPACE();
namespace lf::HWY_NAMESPACE {

// Returns luma for full-range BT.601. The weights have 8 fraction bits.
template <class D16, class V8>
HWY_INLINE auto luma_of(D16 d16, const LumaWeights& of, V8 r, V8 g, V8 b) {
  const auto part = [&](V8 v, uint16_t of) HWY_ATTR { return hn::Mul(hn::PromoteTo(d16, v), hn::Set(d16, of)); };
  const auto sum = hn::Add(hn::Add(part(r, of.r), part(g, of.g)), hn::Add(part(b, of.b), hn::Set(d16, 128)));
  return hn::ShiftRight<8>(sum);
}

// Converts 16-bit values up to 255 to bytes.
template <class D16, class V16>
HWY_INLINE auto to_bytes(D16 /*d16*/, V16 v) {
  return hn::DemoteTo(hn::Rebind<uint8_t, D16>(), hn::BitCast(hn::RebindToSigned<D16>(), v));
}

// Computes the luma of `n` pixels, which have kStride bytes each.
template <int kStride>
HWY_INLINE void luma_row(const uint8_t* HWY_RESTRICT pixel, const RgbLayout& at, const LumaWeights& of, int n,
                         uint8_t* HWY_RESTRICT out) {
  map_lanes<uint16_t>(n, [&](auto d16, int i) HWY_ATTR {
    const hn::Rebind<uint8_t, decltype(d16)> d8;
    auto v0 = hn::Zero(d8), v1 = v0, v2 = v0, v3 = v0;
    if constexpr (kStride == 3)
      hn::LoadInterleaved3(d8, pixel + ptrdiff_t{3} * i, v0, v1, v2);
    else
      hn::LoadInterleaved4(d8, pixel + ptrdiff_t{4} * i, v0, v1, v2, v3);
    const auto channel = [&](int c) HWY_ATTR { return c == 0 ? v0 : c == 1 ? v1 : c == 2 ? v2 : v3; };
    hn::StoreU(to_bytes(d16, luma_of(d16, of, channel(at.r), channel(at.g), channel(at.b))), d8, out + i);
  });
}

HWY_INLINE void rgb_luma_row(const uint8_t* HWY_RESTRICT pixel, const RgbLayout& at, const LumaWeights& of, int n,
                             uint8_t* HWY_RESTRICT out) {
  if (at.pixel_stride == 3) return luma_row<3>(pixel, at, of, n, out);
  if (at.pixel_stride == 4) return luma_row<4>(pixel, at, of, n, out);
  for (int i = 0; i < n; i++, pixel += at.pixel_stride)
    out[i] = static_cast<uint8_t>((of.r * pixel[at.r] + of.g * pixel[at.g] + of.b * pixel[at.b] + 128) >> 8);
}

// Rows of luma, as input for computing values. They have kHypothesisBox - 1 more rows and columns than the values.
// `first` points to the luma at row -1 and column -1.
struct LumaRows {
  const uint8_t* first;
  ptrdiff_t stride;
};

// Computes the means of 4x4 boxes. The values are computed column by column from top to bottom, so that the sums of
// shared rows stay in registers.
void means(const LumaRows& luma, int width, int height, uint16_t* HWY_RESTRICT out) {
  static_assert(kHypothesisBox == 4);
  map_lanes<uint16_t>(width, [&](auto d16, int x) HWY_ATTR {
    const hn::Rebind<uint8_t, decltype(d16)> d8;
    const uint8_t* HWY_RESTRICT from = luma.first + x;
    const auto next_row = [&]() HWY_ATTR {
      const auto at = [&](int k) HWY_ATTR { return hn::PromoteTo(d16, hn::LoadU(d8, from + k)); };
      const auto sum = hn::Add(hn::Add(at(0), at(1)), hn::Add(at(2), at(3)));
      from += luma.stride;
      return sum;
    };
    const auto rounding = hn::Set(d16, 8);
    auto last = next_row(), before_last = last;
    const auto next_two = [&]() HWY_ATTR {  // the sum of the last two rows
      before_last = last;
      last = next_row();
      return hn::Add(before_last, last);
    };
    auto two = next_two();        // rows -1 and 0 for value 0
    auto two_after = next_two();  // rows 0 and 1
    auto two_below = next_two();  // rows 1 and 2
    auto mean = hn::ShiftRight<4>(hn::Add(hn::Add(two, two_below), rounding));
    uint16_t* HWY_RESTRICT to = out + x;
    for (int y = 0; y < height; y++, to += width) {
      two = two_after;
      two_after = two_below;
      two_below = next_two();
      const auto below = hn::ShiftRight<4>(hn::Add(hn::Add(two, two_below), rounding));
      hn::StoreU(hn::Or(mean, hn::ShiftLeft<8>(below)), d16, to);
      mean = below;
    }
  });
}

// Computes the luma of pixels [x0, x1) in row y of an image.
HWY_INLINE void read_luma(const ImageView& image, const LumaWeights& of, int y, int x0, int x1, uint8_t* out) {
  const uint8_t* const row = image.plane[0] + y * image.stride[0];
  if (image.family == PixelFamily::kI420)
    std::copy_n(row + x0, x1 - x0, out);
  else
    rgb_luma_row(row + ptrdiff_t{x0} * image.layout.pixel_stride, image.layout, of, x1 - x0, out);
}

// Computes the values of `rect` for the smallest box. `memory` is temporary memory for the luma of `rect` with
// kHypothesisBox more rows and columns.
void box(const ImageView& image, const LumaWeights& of, const Rect& rect, uint8_t* memory, uint16_t* out) {
  constexpr int kBefore = kHypothesisBox / 2 - 1, kMore = kHypothesisBox - 1;
  // One more row of values, for the upper bytes.
  const Rect needed{rect.x0 - kBefore, rect.y0 - kBefore, rect.x1 - kBefore + kMore, rect.y1 + 1 - kBefore + kMore};
  const Rect there = intersect(needed, {0, 0, image.width, image.height});
  if (image.family == PixelFamily::kI420 && there == needed) {
    means({image.plane[0] + needed.y0 * image.stride[0] + needed.x0, image.stride[0]}, rect.width(), rect.height(),
          out);
    return;
  }
  // Computes the luma of all rows before the means, because reading recently written bytes at other offsets would stall
  // the processor.
  const ptrdiff_t stride = needed.width();
  const auto row = [&](int y) { return memory + (y - needed.y0) * stride; };
  for (int y = there.y0; y < there.y1; y++) {
    uint8_t* const inside = row(y) + (there.x0 - needed.x0);
    read_luma(image, of, y, there.x0, there.x1, inside);
    std::fill(row(y), inside, *inside);
    std::fill(inside + there.width(), row(y) + stride, inside[there.width() - 1]);
  }
  for (int y = needed.y0; y < there.y0; y++) std::copy_n(row(there.y0), stride, row(y));
  for (int y = there.y1; y < needed.y1; y++) std::copy_n(row(there.y1 - 1), stride, row(y));
  means({memory, stride}, rect.width(), rect.height(), out);
}

// Computes the values of boxes that are twice as large, as the means of four values `offset` columns and rows away.
// Skips the outer `offset` rows and columns. Works in place, because values are only read at or behind the position of
// writes.
void widen(int width, int height, int offset, uint16_t* values) {
  const ptrdiff_t stride = width, below = 2 * offset * stride;
  const int inner = width - 2 * offset;
  for (int y = 0; y < height - 2 * offset; y++) {
    const uint16_t* const from = values + y * stride;
    uint16_t* const to = values + ptrdiff_t{y} * inner;
    // map_lanes() would read overwritten values again.
    for_lanes<uint16_t>(inner, [&](auto d, int x) HWY_ATTR {
      const auto at = [&](ptrdiff_t place) HWY_ATTR { return hn::LoadU(d, from + x + place); };
      const auto a = at(0), b = at(2 * offset), e = at(below), f = at(below + 2 * offset);
      const auto low = hn::Set(d, 255), rounding = hn::Set(d, 2);
      const auto mean = [&](auto p, auto q, auto r, auto s) HWY_ATTR {
        return hn::ShiftRight<2>(hn::Add(hn::Add(hn::Add(p, q), hn::Add(r, s)), rounding));
      };
      const auto value = mean(hn::And(a, low), hn::And(b, low), hn::And(e, low), hn::And(f, low));
      const auto next = mean(hn::ShiftRight<8>(a), hn::ShiftRight<8>(b), hn::ShiftRight<8>(e), hn::ShiftRight<8>(f));
      hn::StoreU(hn::Or(value, hn::ShiftLeft<8>(next)), d, to + x);
    });
  }
}

// Samples bilinearly at `count` positions, which have 8 fraction bits.
void samples(const BoxedLuma& luma, const int32_t* HWY_RESTRICT x, const int32_t* HWY_RESTRICT y, int count,
             int16_t* HWY_RESTRICT out) {
  const hn::CappedTag<int32_t, kHypothesisPadding> d;
  const hn::RebindToUnsigned<decltype(d)> du;
  const hn::Rebind<int16_t, decltype(d)> d16;
  const auto fraction = hn::Set(du, 255), one = hn::Set(du, 256), bytes = hn::Set(du, 0x00FF00FF);
  const auto left = hn::Set(d, luma.rect.x0 * 256), top = hn::Set(d, luma.rect.y0 * 256);
  const auto width = hn::Set(d, luma.rect.width()), none = hn::Set(d, -1);
  for (int i = 0; i < count; i += static_cast<int>(hn::Lanes(d))) {
    const auto absolute = hn::LoadU(d, x + i);
    const auto seen = hn::Gt(absolute, none);
    const auto fx = hn::IfThenElseZero(seen, hn::Sub(absolute, left));
    const auto fy = hn::IfThenElseZero(seen, hn::Sub(hn::LoadU(d, y + i), top));
    const auto place = hn::Add(hn::Mul(hn::ShiftRight<8>(fy), width), hn::ShiftRight<8>(fx));
    // Each 32-bit lane gets a value and the value below, and then both for the right neighbour. A neighbour beyond the
    // last column or row has factor 0.
    const auto four = hn::BitCast(
        du, hn::GatherOffset(d, reinterpret_cast<const int32_t*>(luma.values.data()), hn::ShiftLeft<1>(place)));
    const auto ax = hn::And(hn::BitCast(du, fx), fraction), ay = hn::And(hn::BitCast(du, fy), fraction);
    // Interpolates vertically, for the left and the right column at once in one 32-bit number. Neither exceeds 16 bits.
    const auto both =
        hn::Add(hn::Mul(hn::And(four, bytes), hn::Sub(one, ay)), hn::Mul(hn::And(hn::ShiftRight<8>(four), bytes), ay));
    const auto sum =
        hn::Add(hn::Mul(hn::And(both, hn::Set(du, 0xFFFF)), hn::Sub(one, ax)), hn::Mul(hn::ShiftRight<16>(both), ax));
    const auto value = hn::BitCast(d, hn::ShiftRight<16>(hn::Add(sum, hn::Set(du, 1 << 15))));
    hn::StoreU(hn::DemoteTo(d16, hn::IfThenElse(seen, value, none)), d16, out + i);
  }
}

void weigh(const float* HWY_RESTRICT weight, const int16_t* HWY_RESTRICT values, int count, const HypothesisSums& out) {
  const hn::CappedTag<float, kHypothesisPadding> d;
  const hn::Rebind<int32_t, decltype(d)> d32;
  const hn::Rebind<int16_t, decltype(d)> d16;
  for (int i = 0; i < count; i += static_cast<int>(hn::Lanes(d))) {
    // The same as PhotoConsistency::luma_of() and square_of().
    const auto value = hn::PromoteTo(d32, hn::LoadU(d16, values + i));
    const auto all = hn::Mul(hn::LoadU(d, weight + i), hn::Set(d, PhotoConsistency::kWeightOne));
    const auto rounded = hn::ConvertTo(d32, hn::Add(all, hn::Set(d, 0.5f)));
    const auto w = hn::IfThenElseZero(hn::Gt(value, hn::Set(d32, -1)), rounded);
    const auto luma = hn::ShiftRight<8>(hn::Add(hn::Mul(w, value), hn::Set(d32, 128)));
    const auto square = hn::ShiftRight<7>(hn::Add(hn::Mul(luma, value), hn::Set(d32, 64)));
    const auto store = [&](hn::Vec<decltype(d32)> sum, uint16_t* to) HWY_ATTR {
      const hn::Rebind<uint16_t, decltype(d)> du16;
      hn::StoreU(hn::DemoteTo(du16, sum), du16, to + i);
    };
    store(w, out.weight);
    store(luma, out.luma);
    store(square, out.square);
  }
}

// Adds n sums to `to`. `room` is the number of values that may be accessed from `to` on.
HWY_INLINE void add_row(const uint16_t* HWY_RESTRICT from, int n, size_t room, uint16_t* HWY_RESTRICT to) {
  const hn::CappedTag<uint16_t, kHypothesisPadding> d;
  const hn::CappedTag<uint16_t, 1> d1;
  const int lanes = static_cast<int>(hn::Lanes(d));
  int i = 0;
  // The last vector may extend beyond the row, where it adds 0, if the array has values there.
  for (; i < n && static_cast<size_t>(i + lanes) <= room; i += lanes) {
    const auto more = hn::IfThenElseZero(hn::FirstN(d, static_cast<size_t>(n - i)), hn::LoadU(d, from + i));
    hn::StoreU(hn::SaturatedAdd(hn::LoadU(d, to + i), more), d, to + i);
  }
  for (; i < n; i++) hn::StoreU(hn::SaturatedAdd(hn::LoadU(d1, to + i), hn::LoadU(d1, from + i)), d1, to + i);
}

void add(std::span<const HypothesisRow> rows, const HypothesisSums& more, int columns, size_t nodes,
         const HypothesisSums& sums) {
  for (const HypothesisRow& row : rows) {
    const size_t begin = static_cast<size_t>(row.y) * columns + row.x0, room = nodes - begin;
    const int count = row.x1 - row.x0;
    add_row(more.weight + row.first, count, room, sums.weight + begin);
    add_row(more.luma + row.first, count, room, sums.luma + begin);
    add_row(more.square + row.first, count, room, sums.square + begin);
  }
}

}  // namespace lf::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lf {
namespace {

HWY_EXPORT(box);
HWY_EXPORT(widen);

}  // namespace

void box_luma(const ImageView& image, const Rect& rect, BoxedLuma& out, int box) {
  out.rect = rect;
  const int more = (box - kHypothesisBox) / 2;  // extra values on each side, the input of larger boxes
  Rect all{rect.x0 - more, rect.y0 - more, rect.x1 + more, rect.y1 + more};
  const auto width = static_cast<size_t>(all.width()), height = static_cast<size_t>(all.height());
  out.values.resize(width * height + BoxedLuma::kSpare);
  thread_local ByteBuffer memory;
  memory.resize((width + kHypothesisBox) * (height + kHypothesisBox));
  HWY_DYNAMIC_DISPATCH(box)(image, {77, 150, 29}, all, memory.data(), out.values.data());
  for (int offset = kHypothesisBox / 2; 2 * offset < box; offset *= 2) {
    HWY_DYNAMIC_DISPATCH(widen)(all.width(), all.height(), offset, out.values.data());
    all = {all.x0 + offset, all.y0 + offset, all.x1 - offset, all.y1 - offset};
  }
  out.values.resize(static_cast<size_t>(rect.width()) * rect.height() + BoxedLuma::kSpare);
  std::fill_n(out.values.end() - BoxedLuma::kSpare, BoxedLuma::kSpare, uint16_t{0});
  constexpr size_t kKept = size_t{1} << 20;  // releases memory after large images
  if (memory.size() > kKept) memory = ByteBuffer();
}

HWY_EXPORT(samples);
HWY_EXPORT(weigh);
HWY_EXPORT(add);

HypothesisValues sample_hypotheses(const HypothesisProjection& projection, const HypothesisRays& rays,
                                   const ByteBuffer& levels, const ImageView& image) {
  const size_t stride = static_cast<size_t>(rays.count) + kHypothesisPadding;
  thread_local UninitializedVector<int32_t> x, y;
  thread_local BoxedLuma luma;
  x.resize(levels.size());
  y.resize(levels.size());
  const PlaceBounds all =
      place_hypotheses(projection, rays, levels.data(), static_cast<int>(levels.size() / stride), x.data(), y.data());
  const Rect rect{all.left >> 8, all.top >> 8, std::min((all.right >> 8) + 2, image.width), (all.bottom >> 8) + 1};
  box_luma(image, all.right < 0 ? Rect{0, 0, 1, 1} : rect, luma, projection.box);
  HypothesisValues values(levels.size());
  for (size_t at = 0; at < levels.size(); at += stride)
    HWY_DYNAMIC_DISPATCH(samples)(luma, &x[at], &y[at], rays.count, &values[at]);
  constexpr size_t kKept = size_t{1} << 19;  // releases memory after large images
  if (luma.values.size() > kKept) luma = BoxedLuma();
  return values;
}

void weigh_hypothesis(const float* weight, const int16_t* values, int count, const HypothesisSums& out) {
  HWY_DYNAMIC_DISPATCH(weigh)(weight, values, count, out);
}

void add_rows(std::span<const HypothesisRow> rows, const HypothesisSums& more, int columns, size_t nodes,
              const HypothesisSums& sums) {
  HWY_DYNAMIC_DISPATCH(add)(rows, more, columns, nodes, sums);
}

}  // namespace lf
#endif
