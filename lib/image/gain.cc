// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/gain.h"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "image/gain.cc"
#include <hwy/foreach_target.h>  // has to precede highway.h
#include <hwy/highway.h>

#include "base/for_lanes-inl.h"
#include "image/image_copy.h"

HWY_BEFORE_NAMESPACE();
namespace lf::HWY_NAMESPACE {

// Factors have 14 bits of fraction, products of values with 7 bits 5 of what is left of them.
constexpr int kValueBits = 7, kLeftBits = 5;

// `zero`: the value of no colour. Values may be divided in place.
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

}  // namespace lf::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lf {

HWY_EXPORT(divide_row);

namespace {

int factor_of(float gain) { return static_cast<int>(std::clamp<long>(std::lround((1 << 14) / gain), 0, 32767)); }

}  // namespace

ImageView divide_by_gain(const ImageView& image, const Rect& rect, float gain, ByteBuffer& memory) {
  const int factor = factor_of(gain);
  return write_copy(image, rect, memory, [factor](const PlaneCopy& plane) {
    for (int y = plane.part.y0; y < plane.part.y1; y++) {
      const ptrdiff_t at = y * plane.stride + ptrdiff_t{plane.part.x0} * plane.step;
      HWY_DYNAMIC_DISPATCH(divide_row)
      (plane.from + at, plane.part.width() * plane.step, factor, plane.index == 0 ? 0 : 128, plane.to + at);
    }
  });
}

void divide_by_gain(std::span<uint8_t> luma, float gain) {
  HWY_DYNAMIC_DISPATCH(divide_row)(luma.data(), static_cast<int>(luma.size()), factor_of(gain), 0, luma.data());
}

}  // namespace lf
#endif
