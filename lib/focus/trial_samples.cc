// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/trial_samples.h"

#include <algorithm>

#include "focus/boxed_luma.h"
#include "focus/moments.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "focus/trial_samples.cc"
#include <hwy/foreach_target.h>  // has to precede highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lf::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Bilinear, in 8 bits of fraction.
void samples(const BoxedLuma& luma, const int32_t* HWY_RESTRICT x, const int32_t* HWY_RESTRICT y, int count,
             int16_t* HWY_RESTRICT out) {
  const hn::CappedTag<int32_t, kTrialSpare> d;
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
    // A value, that below it, and the same of its neighbour: beyond the last column and row their factor is 0.
    const auto four = hn::BitCast(
        du, hn::GatherOffset(d, reinterpret_cast<const int32_t*>(luma.values.data()), hn::ShiftLeft<1>(place)));
    const auto ax = hn::And(hn::BitCast(du, fx), fraction), ay = hn::And(hn::BitCast(du, fy), fraction);
    // Left and right in one number: neither has more than 16 bits.
    const auto both =
        hn::Add(hn::Mul(hn::And(four, bytes), hn::Sub(one, ay)), hn::Mul(hn::And(hn::ShiftRight<8>(four), bytes), ay));
    const auto sum =
        hn::Add(hn::Mul(hn::And(both, hn::Set(du, 0xFFFF)), hn::Sub(one, ax)), hn::Mul(hn::ShiftRight<16>(both), ax));
    const auto value = hn::BitCast(d, hn::ShiftRight<16>(hn::Add(sum, hn::Set(du, 1 << 15))));
    hn::StoreU(hn::DemoteTo(d16, hn::IfThenElse(seen, value, none)), d16, out + i);
  }
}

void weigh(const float* HWY_RESTRICT weight, const int16_t* HWY_RESTRICT values, int count, const TrialSums& out) {
  const hn::CappedTag<float, kTrialSpare> d;
  const hn::Rebind<int32_t, decltype(d)> d32;
  const hn::Rebind<int16_t, decltype(d)> d16;
  for (int i = 0; i < count; i += static_cast<int>(hn::Lanes(d))) {
    // Moments::luma_of() and square_of().
    const auto value = hn::PromoteTo(d32, hn::LoadU(d16, values + i));
    const auto all = hn::Mul(hn::LoadU(d, weight + i), hn::Set(d, Moments::kWeightOne));
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

// n sums. `room`: how many there are behind `to`.
HWY_INLINE void add_row(const uint16_t* HWY_RESTRICT from, int n, size_t room, uint16_t* HWY_RESTRICT to) {
  const hn::CappedTag<uint16_t, kTrialSpare> d;
  const hn::CappedTag<uint16_t, 1> d1;
  const int lanes = static_cast<int>(hn::Lanes(d));
  int i = 0;
  // The last vector adds nothing behind the row, where there is anything.
  for (; i < n && static_cast<size_t>(i + lanes) <= room; i += lanes) {
    const auto more = hn::IfThenElseZero(hn::FirstN(d, static_cast<size_t>(n - i)), hn::LoadU(d, from + i));
    hn::StoreU(hn::SaturatedAdd(hn::LoadU(d, to + i), more), d, to + i);
  }
  for (; i < n; i++) hn::StoreU(hn::SaturatedAdd(hn::LoadU(d1, to + i), hn::LoadU(d1, from + i)), d1, to + i);
}

void add(std::span<const TrialRow> rows, const TrialSums& more, int columns, size_t nodes, const TrialSums& sums) {
  for (const TrialRow& row : rows) {
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

HWY_EXPORT(samples);
HWY_EXPORT(weigh);
HWY_EXPORT(add);

TrialValues see_trials(const TrialProjection& projection, const TrialRays& rays, const ByteBuffer& levels,
                       const ImageView& image) {
  const size_t stride = static_cast<size_t>(rays.count) + kTrialSpare;
  thread_local UninitializedVector<int32_t> x, y;
  thread_local BoxedLuma luma;
  x.resize(levels.size());
  y.resize(levels.size());
  const PlaceBounds all =
      place_trials(projection, rays, levels.data(), static_cast<int>(levels.size() / stride), x.data(), y.data());
  const Rect rect{all.left >> 8, all.top >> 8, std::min((all.right >> 8) + 2, image.width), (all.bottom >> 8) + 1};
  box_luma(image, all.right < 0 ? Rect{0, 0, 1, 1} : rect, luma);
  TrialValues values(levels.size());
  for (size_t at = 0; at < levels.size(); at += stride)
    HWY_DYNAMIC_DISPATCH(samples)(luma, &x[at], &y[at], rays.count, &values[at]);
  constexpr size_t kKept = size_t{1} << 19;  // of whole large images nothing is kept
  if (luma.values.size() > kKept) luma = BoxedLuma();
  return values;
}

void weigh_trial(const float* weight, const int16_t* values, int count, const TrialSums& out) {
  HWY_DYNAMIC_DISPATCH(weigh)(weight, values, count, out);
}

void add_rows(std::span<const TrialRow> rows, const TrialSums& more, int columns, size_t nodes, const TrialSums& sums) {
  HWY_DYNAMIC_DISPATCH(add)(rows, more, columns, nodes, sums);
}

}  // namespace lf
#endif
