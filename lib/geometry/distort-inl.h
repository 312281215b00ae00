// SPDX-License-Identifier: LGPL-2.1-or-later
// Included once per instruction set: Lens::project() for vectors.
#if defined(LF_GEOMETRY_DISTORT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_GEOMETRY_DISTORT_INL_H_
#undef LF_GEOMETRY_DISTORT_INL_H_
#else
#define LF_GEOMETRY_DISTORT_INL_H_
#endif

#include <hwy/highway.h>

#include "geometry/lens.h"

HWY_BEFORE_NAMESPACE();
namespace lf::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Multiplies and adds. kFused rounds once where the instruction set can; otherwise all instruction sets get the same
// bits.
template <bool kFused, class V>
HWY_INLINE V times_plus(V a, V b, V c) {
  if constexpr (kFused) return hn::MulAdd(a, b, c);
  return hn::Add(hn::Mul(a, b), c);
}

// Returns (angle / 2) / tan(angle / 2) for w = tan^2(angle / 2) <= kFisheyeLimit, with an error of 1e-7 (float) or
// 1e-12 (double): a polynomial in 2 w / kFisheyeLimit - 1 (Chebyshev interpolation). Even and odd powers are summed
// separately, because one long chain of sums would be slow.
template <bool kFused, class D, class V = hn::Vec<D>>
HWY_INLINE V half_angle_ratio(D d, V w) {
  using T = hn::TFromD<D>;
  constexpr T kFloat[] = {0.8516929581704493,     -0.11246026748429103,   0.025863106725752767,
                          -0.007005602278681755,  0.002054280502154609,   -0.0006158360305884351,
                          0.00019516860110357066, -8.459672773395494e-05, 2.8127337224779443e-05};
  constexpr T kDouble[] = {
      0.8516929581702313,    -0.112460600324359,     0.025863219897477994,   -0.007001203195449901,
      0.0020527847146417626, -0.0006312997883407813, 0.00020042734531562937, -6.509646768005576e-05,
      2.148911928657668e-05, -7.1949121019019e-06,   2.47417806580226e-06,   -8.451552438674265e-07,
      2.443760349149504e-07, -8.427520946027722e-08, 5.7798839186995465e-08, -2.0281384502385258e-08};
  constexpr T kScale = static_cast<T>(2 / kFisheyeLimit);
  const V x = times_plus<kFused>(w, hn::Set(d, kScale), hn::Set(d, T{-1})), x2 = hn::Mul(x, x);
  const auto polynomial = [&](const auto& terms) HWY_ATTR {
    const auto every_second = [&](size_t i) HWY_ATTR {
      V sum = hn::Set(d, terms[i]);
      for (; i >= 2; i -= 2) sum = times_plus<kFused>(sum, x2, hn::Set(d, terms[i - 2]));
      return sum;
    };
    const size_t last = std::size(terms) - 1, odd = last - (last + 1) % 2;
    return times_plus<kFused>(every_second(odd), x, every_second(2 * last - 1 - odd));
  };
  if constexpr (sizeof(T) == sizeof(float)) return polynomial(kFloat);
  return polynomial(kDouble);
}

// Computes the distorted coordinates of (a, b) in place. `q` is a^2 + b^2.
template <bool kFused, class D, class Terms, class V = hn::Vec<D>>
HWY_INLINE void bend(D d, const Terms& of, V q, V& a, V& b) {
  using T = hn::TFromD<D>;
  const auto set = [&](T value) HWY_ATTR { return hn::Set(d, value); };
  V g;
  if (HWY_LIKELY(!of.is_general)) {
    g = times_plus<kFused>(q, times_plus<kFused>(q, set(of.k[1]), set(of.k[0])), set(1));
  } else {
    const V end = times_plus<kFused>(q, times_plus<kFused>(q, set(of.k[3]), set(of.k[2])), set(of.k[1]));
    g = times_plus<kFused>(q, times_plus<kFused>(q, end, set(of.k[0])), set(1));
    if (of.is_rational) {
      const V rest = times_plus<kFused>(q, times_plus<kFused>(q, set(of.d[2]), set(of.d[1])), set(of.d[0]));
      g = hn::Div(g, times_plus<kFused>(q, rest, set(1)));
    }
  }
  const V u = a, v = b;
  a = hn::Mul(u, g), b = hn::Mul(v, g);
  if (of.is_tangential) {
    const V two_uv = hn::Mul(hn::Add(u, u), v), p1 = set(of.p1), p2 = set(of.p2);
    a = times_plus<kFused>(p2, times_plus<kFused>(hn::Add(u, u), u, q), times_plus<kFused>(p1, two_uv, a));
    b = times_plus<kFused>(p1, times_plus<kFused>(hn::Add(v, v), v, q), times_plus<kFused>(p2, two_uv, b));
  }
  if (of.is_prism) {
    a = times_plus<kFused>(q, set(of.s1), a);
    b = times_plus<kFused>(q, set(of.s2), b);
  }
}

// Maps a point in camera coordinates to distorted normalised coordinates x and y, in place. A fisheye lens replaces z
// by the distance of the point, which is negative beyond kFisheyeLimit. Returns the value for the caller's test against
// Distortion::limit. If it fails, or if z is not positive, x and y are arbitrary.
template <bool kFused, class D, class Terms, class V = hn::Vec<D>>
HWY_INLINE V through_lens(D d, const Terms& of, bool is_distorted, V& x, V& y, V& z) {
  using T = hn::TFromD<D>;
  if (HWY_UNLIKELY(of.fisheye)) {
    // With the distance D, tan(angle / 2) = R / (D + Z), and its square is (D - Z) / (D + Z) = 1 - 2 Z / (D + Z).
    const V distance = hn::Sqrt(times_plus<kFused>(x, x, times_plus<kFused>(y, y, hn::Mul(z, z))));
    const V h = hn::Div(hn::Set(d, T{2}), hn::Add(distance, z));
    const V w = kFused ? hn::NegMulAdd(z, h, hn::Set(d, T{1})) : hn::Sub(hn::Set(d, T{1}), hn::Mul(z, h));
    const V ratio = hn::Mul(h, half_angle_ratio<kFused>(d, w));
    x = hn::Mul(x, ratio);
    y = hn::Mul(y, ratio);
    z = hn::IfThenElse(hn::Le(w, hn::Set(d, static_cast<T>(kFisheyeLimit))), distance, hn::Neg(distance));
    bend<kFused>(d, of, times_plus<kFused>(x, x, hn::Mul(y, y)), x, y);
    return w;
  }
  if constexpr (kFused) {
    const V per_z = hn::Div(hn::Set(d, T{1}), z);
    x = hn::Mul(x, per_z);
    y = hn::Mul(y, per_z);
  } else {
    x = hn::Div(x, z);
    y = hn::Div(y, z);
  }
  const V r2 = times_plus<kFused>(x, x, hn::Mul(y, y));
  if (is_distorted) bend<kFused>(d, of, r2, x, y);
  return r2;
}

}  // namespace lf::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
