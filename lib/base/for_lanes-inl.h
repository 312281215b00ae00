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

// Calls step(d, i) until all of 0..n are done, d being the tag of as many values of T as it is to handle from i on: of
// the longest vectors, of 16 bytes, then of one value. Rows of fragments are short: their ends count.
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

// Calls step(d, i) as for_lanes() does, for steps that may do a value twice, as those that do not change what they
// read: the last vector begins before the others end.
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
