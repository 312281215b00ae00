// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/add_rows.h"

#include "render/sum_planes.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "composite/add_rows.cc"
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

// n / 255 in units of 1 / kLostOne as widen_lost() has it: 128 n + (n + 1) / 2.
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

}  // namespace lf
#endif
