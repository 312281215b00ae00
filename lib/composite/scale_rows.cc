// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/scale_rows.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "composite/scale_rows.cc"
#include <hwy/foreach_target.h>  // has to precede highway.h
#include <hwy/highway.h>

#include "base/for_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lf::HWY_NAMESPACE {
void scales_of(float* HWY_RESTRICT scale, const uint16_t* HWY_RESTRICT lost, int n) {
  for_lanes<float>(n, [&](auto d, int i) HWY_ATTR {
    const hn::Rebind<int32_t, decltype(d)> d32;
    const hn::Rebind<uint16_t, decltype(d)> d16;
    const auto lost_weight = hn::ConvertTo(d, hn::PromoteTo(d32, hn::LoadU(d16, lost + i)));
    const auto left = hn::Sub(hn::Set(d, kLostOne), lost_weight);
    const auto enough = hn::Ge(left, hn::Set(d, kLeastWeight));
    const auto one = hn::Set(d, kLostOne / static_cast<float>(1 << kSumFractionBits));
    hn::StoreU(hn::IfThenElseZero(enough, hn::Div(one, left)), d, scale + i);
  });
}

void scaled(uint8_t* HWY_RESTRICT out, const int16_t* HWY_RESTRICT sum, const float* HWY_RESTRICT scale,
            float background, int n) {
  for_lanes<float>(n, [&](auto d, int i) HWY_ATTR {
    const hn::Rebind<int32_t, decltype(d)> d32;
    const hn::Rebind<int16_t, decltype(d)> d16;
    const hn::Rebind<uint8_t, decltype(d)> d8;
    const auto s = hn::LoadU(d, scale + i);
    const auto value = hn::Mul(hn::ConvertTo(d, hn::PromoteTo(d32, hn::LoadU(d16, sum + i))), s);
    const auto shown = hn::IfThenElse(hn::Eq(s, hn::Zero(d)), hn::Set(d, background), value);
    const auto rounded = hn::Add(shown, hn::Set(d, 0.5f));
    const auto level = hn::Min(hn::Max(rounded, hn::Zero(d)), hn::Set(d, 255.f));
    hn::StoreU(hn::DemoteTo(d8, hn::ConvertTo(d32, level)), d8, out + i);
  });
}

}  // namespace lf::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lf {

HWY_EXPORT(scales_of);
HWY_EXPORT(scaled);

void make_scales(float* scale, const uint16_t* lost, int n) { HWY_DYNAMIC_DISPATCH(scales_of)(scale, lost, n); }
void scale_row(uint8_t* out, const int16_t* sum, const float* scale, float background, int n) {
  HWY_DYNAMIC_DISPATCH(scaled)(out, sum, scale, background, n);
}

}  // namespace lf
#endif
