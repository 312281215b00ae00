// SPDX-License-Identifier: LGPL-2.1-or-later
// Included by files that Highway compiles once for each instruction set, behind hwy/foreach_target.h.
#if defined(LF_BASE_FOR_LANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_BASE_FOR_LANES_INL_H_
#undef LF_BASE_FOR_LANES_INL_H_
#else
#define LF_BASE_FOR_LANES_INL_H_
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lf::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Calls step(d, i) for consecutive blocks that cover 0..n. `d` is the Highway tag of the block at i: first full
// vectors, then vectors of 16 bytes, then single values.
template <typename T, typename Step>
HWY_INLINE void for_lanes(int n, const Step& step) {
  const hn::ScalableTag<T> d;
  const hn::CappedTag<T, 16 / sizeof(T)> shorter;
  const hn::CappedTag<T, 1> one;
  const int lanes = static_cast<int>(hn::Lanes(d)), few = static_cast<int>(hn::Lanes(shorter));
  int i = 0;
  for (; i + lanes <= n; i += lanes) step(d, i);
  for (; i + few <= n; i += few) step(shorter, i);
  for (; i < n; i++) step(one, i);
}

// Does the same as for_lanes(), but the last vector may overlap the previous one, so step() may process a value twice.
// Therefore step() must not modify its input.
template <typename T, typename Step>
HWY_INLINE void map_lanes(int n, const Step& step) {
  const hn::ScalableTag<T> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  if (n < lanes) return for_lanes<T>(n, step);
  for (int i = 0; i + lanes <= n; i += lanes) step(d, i);
  if (n % lanes != 0) step(d, n - lanes);
}

}  // namespace lf::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
