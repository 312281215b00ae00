// SPDX-License-Identifier: LGPL-2.1-or-later
// Per target, see render_band.cc: from float to fixed point.
#if defined(LF_RENDER_SIMD_FIXED_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_RENDER_SIMD_FIXED_INL_H_
#undef LF_RENDER_SIMD_FIXED_INL_H_
#else
#define LF_RENDER_SIMD_FIXED_INL_H_
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lf::simd::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

inline constexpr float kMagic = 12582912;  // 1.5 * 2^23

// The nearest integer, |v| < 2^22, in the low bits of 32: adding kMagic leaves no bits for a fraction. Cheaper than
// a conversion, which must also do right by what doesn't fit.
template <class V>
HWY_INLINE auto to_low_bits(V v) {
  const hn::DFromV<V> d;
  return hn::BitCast(hn::RebindToUnsigned<decltype(d)>(), hn::Add(v, hn::Set(d, kMagic)));
}

// The same modulo 2^16: right for int16_t and uint16_t alike.
template <class D16, class V>
HWY_INLINE auto to_fixed(D16, V v) {
  return hn::TruncateTo(hn::RebindToUnsigned<D16>(), to_low_bits(v));
}

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
