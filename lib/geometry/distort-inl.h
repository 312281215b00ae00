// SPDX-License-Identifier: LGPL-2.1-or-later
// Included once per instruction set: Lens::distort() for vectors.
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

// Returns atan(r) / r, with an error of 1e-7 (float) or 1e-12 (double). With h = 2 / (1 + sqrt(1 + r^2)), the
// half-angle formula gives atan(r) / r = h atan(t) / t with t^2 = 1 - h. The polynomial in 2 h - 1 (Chebyshev
// interpolation) replaces the second factor.
template <bool kFused, class D, class V = hn::Vec<D>>
HWY_INLINE V angle_ratio(D d, V r2) {
  using T = hn::TFromD<D>;
  constexpr T kFloat[] = {0.87041975136710359,    0.10187642831740108,    0.020851816629869138,
                          0.0050323735257309619,  0.0013160437244172682,  0.00035564846467472933,
                          0.00010065994008930565, 3.6454024373553137e-05, 1.0805794997755431e-05};
  constexpr T kDouble[] = {0.87041975136710414,    0.1018765423531878,     0.020851851207940947,
                           0.0050308635495860485,  0.001315585916475855,   0.00036098327560634877,
                           0.00010227692470283027, 2.9644441785118639e-05, 8.743208158061103e-06,
                           2.6275033188009427e-06, 7.9404110711796721e-07, 2.2380128257282191e-07,
                           6.8638958813001721e-08, 3.3376287926027243e-08, 1.0394205673946998e-08};
  const V one = hn::Set(d, T{1});
  const V h = hn::Div(hn::Set(d, T{2}), hn::Add(one, hn::Sqrt(hn::Add(one, r2)))), x = hn::Sub(hn::Add(h, h), one);
  const auto polynomial = [&](const auto& terms) HWY_ATTR {
    V sum = hn::Set(d, terms[std::size(terms) - 1]);
    for (size_t i = std::size(terms) - 1; i-- > 0;) sum = times_plus<kFused>(sum, x, hn::Set(d, terms[i]));
    return sum;
  };
  if constexpr (sizeof(T) == sizeof(float)) return hn::Mul(h, polynomial(kFloat));
  return hn::Mul(h, polynomial(kDouble));
}

// Distorts normalised coordinates in place. Returns r^2 of the undistorted coordinates, for the caller's test against
// Distortion::max_r2. Beyond it, u and v become arbitrary.
template <bool kFused, class D, class Terms, class V = hn::Vec<D>>
HWY_INLINE V distort(D d, const Terms& of, V& u, V& v) {
  using T = hn::TFromD<D>;
  const auto set = [&](T value) HWY_ATTR { return hn::Set(d, value); };
  const V r2 = times_plus<kFused>(u, u, hn::Mul(v, v));
  V q = r2, g;
  if (HWY_LIKELY(!of.is_general)) {
    g = times_plus<kFused>(q, times_plus<kFused>(q, set(of.k[1]), set(of.k[0])), set(1));
  } else {
    if (of.fisheye) {
      const V ratio = angle_ratio<kFused>(d, r2);
      u = hn::Mul(u, ratio);
      v = hn::Mul(v, ratio);
      q = times_plus<kFused>(u, u, hn::Mul(v, v));
    }
    const V end = times_plus<kFused>(q, times_plus<kFused>(q, set(of.k[3]), set(of.k[2])), set(of.k[1]));
    g = times_plus<kFused>(q, times_plus<kFused>(q, end, set(of.k[0])), set(1));
    if (of.is_rational) {
      const V rest = times_plus<kFused>(q, times_plus<kFused>(q, set(of.d[2]), set(of.d[1])), set(of.d[0]));
      g = hn::Div(g, times_plus<kFused>(q, rest, set(1)));
    }
  }
  V a = hn::Mul(u, g), b = hn::Mul(v, g);
  if (of.is_tangential) {
    const V two_uv = hn::Mul(hn::Add(u, u), v), p1 = set(of.p1), p2 = set(of.p2);
    a = times_plus<kFused>(p2, times_plus<kFused>(hn::Add(u, u), u, q), times_plus<kFused>(p1, two_uv, a));
    b = times_plus<kFused>(p1, times_plus<kFused>(hn::Add(v, v), v, q), times_plus<kFused>(p2, two_uv, b));
  }
  if (of.is_prism) {
    a = times_plus<kFused>(q, set(of.s1), a);
    b = times_plus<kFused>(q, set(of.s2), b);
  }
  u = a;
  v = b;
  return r2;
}

}  // namespace lf::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
