// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/rows.h"

#include "render/sum_planes.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "composite/rows.cc"
#include <hwy/foreach_target.h>  // has to precede highway.h
#include <hwy/highway.h>

#include "base/for_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lf::HWY_NAMESPACE {

// to[0..] += v.
template <class D, class V, typename T>
HWY_INLINE void add_to(D d, T* to, V v) {
  hn::StoreU(hn::SaturatedAdd(hn::LoadU(d, to), v), d, to);
}

// Bytes as sums.
template <class D, class V>
HWY_INLINE auto levels(D d, V bytes) {
  return hn::ShiftLeft<kSumFractionBits>(hn::PromoteTo(d, bytes));
}
template <typename Byte, class D>
HWY_INLINE auto load_levels(D d, const Byte* from) {
  return levels(d, hn::LoadU(hn::Rebind<Byte, D>(), from));
}

void add_bytes(int16_t* HWY_RESTRICT sum, const uint8_t* HWY_RESTRICT in, int n) {
  for_lanes<int16_t>(n, [&](auto d, int i) HWY_ATTR { add_to(d, sum + i, load_levels(d, in + i)); });
}

void add_signed_bytes(int16_t* HWY_RESTRICT sum, const int8_t* HWY_RESTRICT in, int n) {
  for_lanes<int16_t>(n, [&](auto d, int i) HWY_ATTR { add_to(d, sum + i, load_levels(d, in + i)); });
}

void add_rgb(int16_t* HWY_RESTRICT r, int16_t* HWY_RESTRICT g, int16_t* HWY_RESTRICT b, const uint8_t* HWY_RESTRICT in,
             int n) {
  for_lanes<int16_t>(n, [&](auto d, int i) HWY_ATTR {
    const hn::Rebind<uint8_t, decltype(d)> d8;
    hn::Vec<decltype(d8)> red, green, blue;
    if constexpr (hn::MaxLanes(d) == 1) {  // interleaved loads read whole vectors
      red = hn::Set(d8, in[3 * i]);
      green = hn::Set(d8, in[3 * i + 1]);
      blue = hn::Set(d8, in[3 * i + 2]);
    } else {
      hn::LoadInterleaved3(d8, in + 3 * i, red, green, blue);
    }
    add_to(d, r + i, levels(d, red));
    add_to(d, g + i, levels(d, green));
    add_to(d, b + i, levels(d, blue));
  });
}

// n / 255 in units of 1 / kLostOne is 128 n + (n + 1) / 2, which is n * 32768 / 255 to the nearest.
void add_lost(uint16_t* HWY_RESTRICT lost, const uint8_t* HWY_RESTRICT in, int n) {
  for_lanes<uint16_t>(n, [&](auto d, int i) HWY_ATTR {
    const auto v = hn::PromoteTo(d, hn::LoadU(hn::Rebind<uint8_t, decltype(d)>(), in + i));
    add_to(d, lost + i, hn::Add(hn::ShiftLeft<7>(v), hn::ShiftRight<1>(hn::Add(v, hn::Set(d, 1)))));
  });
}

void add_sums(int16_t* HWY_RESTRICT sum, const int16_t* HWY_RESTRICT in, int n) {
  for_lanes<int16_t>(n, [&](auto d, int i) HWY_ATTR { add_to(d, sum + i, hn::LoadU(d, in + i)); });
}

void add_lost_sums(uint16_t* HWY_RESTRICT lost, const uint16_t* HWY_RESTRICT in, int n) {
  for_lanes<uint16_t>(n, [&](auto d, int i) HWY_ATTR { add_to(d, lost + i, hn::LoadU(d, in + i)); });
}

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

// To the nearest of 0..255, halves up.
template <class D, class V>
HWY_INLINE auto to_bytes(D d, V v) {
  const auto level = hn::Min(hn::Max(hn::Add(v, hn::Set(d, 0.5f)), hn::Zero(d)), hn::Set(d, 255.f));
  return hn::DemoteTo(hn::Rebind<uint8_t, D>(), hn::ConvertTo(hn::Rebind<int32_t, D>(), level));
}

// The factor is less than 1.
void written(uint8_t* HWY_RESTRICT out, const int16_t* HWY_RESTRICT sum, float factor, float offset, int n) {
  const auto fixed = static_cast<int16_t>(factor * 32768 + 0.5f);
  const auto added = static_cast<int16_t>(offset * (1 << kSumFractionBits) + (1 << (kSumFractionBits - 1)));
  for_lanes<int16_t>(n, [&](auto d, int i) HWY_ATTR {
    const auto level =
        hn::SaturatedAdd(hn::MulFixedPoint15(hn::LoadU(d, sum + i), hn::Set(d, fixed)), hn::Set(d, added));
    const hn::Rebind<uint8_t, decltype(d)> d8;
    hn::StoreU(hn::DemoteTo(d8, hn::ShiftRight<kSumFractionBits>(level)), d8, out + i);
  });
}

void scaled(uint8_t* HWY_RESTRICT out, const int16_t* HWY_RESTRICT sum, const float* HWY_RESTRICT scale,
            float background, float gain, float offset, int n) {
  for_lanes<float>(n, [&](auto d, int i) HWY_ATTR {
    const hn::Rebind<int32_t, decltype(d)> d32;
    const hn::Rebind<int16_t, decltype(d)> d16;
    const hn::Rebind<uint8_t, decltype(d)> d8;
    const auto s = hn::LoadU(d, scale + i);
    const auto value = hn::Mul(hn::ConvertTo(d, hn::PromoteTo(d32, hn::LoadU(d16, sum + i))), s);
    const auto shown = hn::IfThenElse(hn::Eq(s, hn::Zero(d)), hn::Set(d, background), value);
    const auto level = hn::Add(hn::Mul(shown, hn::Set(d, gain)), hn::Set(d, offset));
    hn::StoreU(to_bytes(d, level), d8, out + i);
  });
}

// Plain loops that the compiler makes vector code of, for each instruction set: nothing of std:: in here.

HWY_INLINE int32_t at_most_one(uint16_t lost) { return lost < kLostOne ? lost : kLostOne; }

void pairs_of(int32_t* HWY_RESTRICT lost, int32_t* HWY_RESTRICT hidden, const uint16_t* HWY_RESTRICT row_lost,
              const float* HWY_RESTRICT row_scale, int w) {
  const int pairs = w / 2;
  if (row_lost)
    for (int i = 0; i < pairs; i++) lost[i] += at_most_one(row_lost[2 * i]) + at_most_one(row_lost[2 * i + 1]);
  for (int i = 0; i < pairs; i++) hidden[i] += (row_scale[2 * i] == 0) + (row_scale[2 * i + 1] == 0);
  if (w % 2 == 0) return;
  if (row_lost) lost[pairs] += at_most_one(row_lost[w - 1]);
  hidden[pairs] += row_scale[w - 1] == 0;
}

void chroma_scales_of(float* HWY_RESTRICT scale, float* HWY_RESTRICT share, const int32_t* HWY_RESTRICT lost,
                      const int32_t* HWY_RESTRICT hidden, float pixels, int n) {
  constexpr float kOne = kLostOne / static_cast<float>(1 << kSumFractionBits);
  for (int i = 0; i < n; i++) {
    const float left = kLostOne - static_cast<float>(lost[i]) / pixels;
    const float enough = left < kLeastWeight ? 0.f : 1.f, some = left < kLeastWeight ? 1.f : left;
    scale[i] = enough * (kOne / some);
    share[i] = (1 - enough) + enough * (static_cast<float>(hidden[i]) / pixels);
  }
}

void scaled_chroma(uint8_t* HWY_RESTRICT out, const int16_t* HWY_RESTRICT sum, const float* HWY_RESTRICT scale,
                   const float* HWY_RESTRICT share, float background, float gain, int n) {
  for_lanes<float>(n, [&](auto d, int i) HWY_ATTR {
    const hn::Rebind<int32_t, decltype(d)> d32;
    const hn::Rebind<int16_t, decltype(d)> d16;
    const hn::Rebind<uint8_t, decltype(d)> d8;
    const auto value = hn::ConvertTo(d, hn::PromoteTo(d32, hn::LoadU(d16, sum + i)));
    const auto colour =
        hn::Min(hn::Max(hn::Mul(value, hn::LoadU(d, scale + i)), hn::Set(d, -128.f)), hn::Set(d, 127.f));
    const auto back = hn::LoadU(d, share + i);
    const auto shown = hn::Add(hn::Mul(colour, hn::Sub(hn::Set(d, 1), back)), hn::Mul(hn::Set(d, background), back));
    const auto level = hn::Add(hn::Set(d, 128), hn::Mul(shown, hn::Set(d, gain)));
    hn::StoreU(to_bytes(d, level), d8, out + i);
  });
}

}  // namespace lf::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lf {

HWY_EXPORT(add_bytes);
HWY_EXPORT(add_signed_bytes);
HWY_EXPORT(add_rgb);
HWY_EXPORT(add_lost);
HWY_EXPORT(add_sums);
HWY_EXPORT(add_lost_sums);

void add_row(int16_t* sum, const uint8_t* in, int n) { HWY_DYNAMIC_DISPATCH(add_bytes)(sum, in, n); }
void add_chroma_row(int16_t* sum, const uint8_t* in, int n) {
  HWY_DYNAMIC_DISPATCH(add_signed_bytes)(sum, reinterpret_cast<const int8_t*>(in), n);
}
void add_rgb_row(int16_t* r, int16_t* g, int16_t* b, const uint8_t* in, int n) {
  HWY_DYNAMIC_DISPATCH(add_rgb)(r, g, b, in, n);
}
void add_lost_row(uint16_t* lost, const uint8_t* in, int n) { HWY_DYNAMIC_DISPATCH(add_lost)(lost, in, n); }
void add_sum_row(int16_t* sum, const int16_t* in, int n) { HWY_DYNAMIC_DISPATCH(add_sums)(sum, in, n); }
void add_sum_row(uint16_t* lost, const uint16_t* in, int n) { HWY_DYNAMIC_DISPATCH(add_lost_sums)(lost, in, n); }

HWY_EXPORT(scales_of);
HWY_EXPORT(written);
HWY_EXPORT(scaled);
HWY_EXPORT(pairs_of);
HWY_EXPORT(chroma_scales_of);
HWY_EXPORT(scaled_chroma);

void make_scales(float* scale, const uint16_t* lost, int n) { HWY_DYNAMIC_DISPATCH(scales_of)(scale, lost, n); }
void write_row(uint8_t* out, const int16_t* sum, const Levels& levels, int n) {
  HWY_DYNAMIC_DISPATCH(written)(out, sum, levels.gain, levels.offset, n);
}
void write_chroma_row(uint8_t* out, const int16_t* sum, const Levels& levels, int n) {
  HWY_DYNAMIC_DISPATCH(written)(out, sum, levels.chroma_gain, 128, n);
}
void scale_row(uint8_t* out, const int16_t* sum, const float* scale, float background, const Levels& levels, int n) {
  HWY_DYNAMIC_DISPATCH(scaled)(out, sum, scale, background, levels.gain, levels.offset, n);
}

void add_pairs(int32_t* lost, int32_t* hidden, const uint16_t* row_lost, const float* row_scale, int w) {
  HWY_DYNAMIC_DISPATCH(pairs_of)(lost, hidden, row_lost, row_scale, w);
}
void make_chroma_scales(float* scale, float* share, const int32_t* lost, const int32_t* hidden, float pixels, int n) {
  HWY_DYNAMIC_DISPATCH(chroma_scales_of)(scale, share, lost, hidden, pixels, n);
}
void scale_chroma_row(uint8_t* out, const int16_t* sum, const float* scale, const float* share, float background,
                      const Levels& levels, int n) {
  HWY_DYNAMIC_DISPATCH(scaled_chroma)(out, sum, scale, share, background, levels.chroma_gain, n);
}

}  // namespace lf
#endif
