// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/trial_row.h"

#include "focus/moments.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "focus/trial_row.cc"
#include <hwy/foreach_target.h>  // has to precede highway.h
#include <hwy/highway.h>

#include "base/for_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lf::HWY_NAMESPACE {

template <class D>
using V = hn::Vec<D>;

template <class D>
struct CameraVectors {
  V<D> base[3], slope[3];  // camera coordinates
};

template <class D>
HWY_INLINE CameraVectors<D> look(D d, const TrialProjection& camera, V<D> u, V<D> v) {
  CameraVectors<D> out;
  const auto times = [&](const float* row) HWY_ATTR {
    return hn::MulAdd(u, hn::Set(d, row[0]), hn::MulAdd(v, hn::Set(d, row[1]), hn::Set(d, row[2])));
  };
  for (int k = 0; k < 3; k++) {
    out.base[k] = times(camera.base + 3 * k);
    out.slope[k] = times(camera.slope + 3 * k);
  }
  return out;
}

// CameraProjection::project(): the position in the image, and whether anything is seen there.
template <class D>
HWY_INLINE auto project(D d, const TrialProjection& camera, const CameraVectors<D>& at, const uint8_t* levels, V<D>& x,
                        V<D>& y) {
  const hn::Rebind<uint8_t, D> d8;
  const hn::Rebind<int32_t, D> d32;
  const auto level = hn::ConvertTo(d, hn::PromoteTo(d32, hn::LoadU(d8, levels)));
  const auto inverse = hn::MulAdd(level, hn::Set(d, camera.per_level), hn::Set(d, camera.farthest));
  const auto eye = hn::Set(d, camera.eye_distance);
  const auto one = hn::Set(d, 1.f), half = hn::Set(d, -0.5f), zero = hn::Zero(d);
  const auto z = hn::MulAdd(inverse, at.slope[2], at.base[2]);
  auto seen = hn::And(hn::Gt(z, zero), hn::Lt(hn::Mul(inverse, eye), one));
  const auto per_z = hn::Div(one, z);
  auto u = hn::Mul(hn::MulAdd(inverse, at.slope[0], at.base[0]), per_z);
  auto v = hn::Mul(hn::MulAdd(inverse, at.slope[1], at.base[1]), per_z);
  if (camera.distorted) {
    const auto set = [&](float value) HWY_ATTR { return hn::Set(d, value); };
    const auto uu = hn::Mul(u, u), vv = hn::Mul(v, v), uv2 = hn::Mul(hn::Add(u, u), v), r2 = hn::Add(uu, vv);
    const auto stretch = hn::MulAdd(r2, hn::MulAdd(r2, set(camera.k2), set(camera.k1)), one);
    const auto across = hn::MulAdd(set(camera.p1), uv2, hn::Mul(set(camera.p2), hn::Add(r2, hn::Add(uu, uu))));
    const auto down = hn::MulAdd(set(camera.p2), uv2, hn::Mul(set(camera.p1), hn::Add(r2, hn::Add(vv, vv))));
    seen = hn::And(seen, hn::Le(r2, set(camera.max_r2)));
    u = hn::MulAdd(u, stretch, across);
    v = hn::MulAdd(v, stretch, down);
  }
  x = hn::MulAdd(u, hn::Set(d, camera.fx), hn::Set(d, camera.cx));
  y = hn::MulAdd(v, hn::Set(d, camera.fy), hn::Set(d, camera.cy));
  seen = hn::And(seen, hn::And(hn::Ge(x, half), hn::Le(x, hn::Add(hn::Set(d, camera.width), half))));
  return hn::And(seen, hn::And(hn::Ge(y, half), hn::Le(y, hn::Add(hn::Set(d, camera.height), half))));
}

// Bilinear, in 8 bits of fraction; (x, y) relative to the first value.
template <class D>
HWY_INLINE auto sample(D d, const TrialLuma& luma, V<D> x, V<D> y) {
  const hn::Rebind<int32_t, D> d32;
  const auto fixed = [&](V<D> at, int32_t size) HWY_ATTR {
    const auto inside = hn::Min(hn::Max(at, hn::Zero(d)), hn::Set(d, static_cast<float>(size - 1)));
    return hn::ConvertTo(d32, hn::Mul(inside, hn::Set(d, 256.f)));
  };
  const auto fx = fixed(x, luma.width), fy = fixed(y, luma.height);
  const auto byte = hn::Set(d32, 255), one = hn::Set(d32, 256);
  const auto ax = hn::And(fx, byte), ay = hn::And(fy, byte);
  const auto width = hn::Set(d32, luma.width);
  const auto place = hn::Add(hn::Mul(hn::ShiftRight<8>(fy), width), hn::ShiftRight<8>(fx));
  // Two neighbours in one go, and two bytes of no meaning; beyond the last column and row their factor is 0.
  const auto along = [&](V<decltype(d32)> from) HWY_ATTR {
    const auto both = hn::GatherOffset(d32, reinterpret_cast<const int32_t*>(luma.values), from);
    const auto left = hn::And(both, byte), right = hn::And(hn::ShiftRight<8>(both), byte);
    return hn::Add(hn::Mul(left, hn::Sub(one, ax)), hn::Mul(right, ax));
  };
  const auto upper = along(place), lower = along(hn::Add(place, width));
  const auto sum = hn::Add(hn::Mul(upper, hn::Sub(one, ay)), hn::Mul(lower, ay));
  return hn::ShiftRight<16>(hn::Add(sum, hn::Set(d32, 1 << 15)));
}

template <class D>
HWY_INLINE void add_saturated(D d, V<D> value, uint16_t* HWY_RESTRICT sum) {
  const hn::Rebind<uint16_t, D> d16;
  const hn::Rebind<int32_t, D> d32;
  const auto rounded = hn::ConvertTo(d32, hn::Add(value, hn::Set(d, 0.5f)));
  hn::StoreU(hn::SaturatedAdd(hn::LoadU(d16, sum), hn::DemoteTo(d16, rounded)), d16, sum);
}

// Calls step(d, x, inside) for all nodes, d being the tag of as many as it is to handle from x on and `inside` which of
// them are meant. Camera's parts of a row are short, so that the last vector reaches beyond, but not over the row's
// end.
template <typename Step>
HWY_INLINE void for_nodes(const TrialNodes& nodes, const Step& step) {
  const hn::ScalableTag<float> d;
  const hn::CappedTag<float, 1> one;
  const int lanes = static_cast<int>(hn::Lanes(d));
  if (nodes.columns < lanes) {
    for (int x = nodes.first; x < nodes.end; x++) step(one, x, hn::Eq(hn::Zero(one), hn::Zero(one)));
    return;
  }
  const auto end = hn::Set(d, static_cast<float>(nodes.end));
  for (int first = nodes.first; first < nodes.end; first += lanes) {
    const int x = HWY_MIN(first, nodes.columns - lanes);
    const auto place = hn::Iota(d, static_cast<float>(x));
    step(d, x, hn::And(hn::Ge(place, hn::Set(d, static_cast<float>(first))), hn::Lt(place, end)));
  }
}

void positions(const TrialProjection& camera, const TrialNodes& nodes, const uint8_t* HWY_RESTRICT levels,
               float* HWY_RESTRICT out_x, float* HWY_RESTRICT out_y, uint8_t* HWY_RESTRICT seen) {
  for_nodes(nodes, [&](auto d, int i, auto /*inside*/) HWY_ATTR {
    const hn::Rebind<uint8_t, decltype(d)> d8;
    const hn::Rebind<int32_t, decltype(d)> d32;
    const auto at = look(d, camera, hn::LoadU(d, nodes.u + i), hn::LoadU(d, nodes.v + i));
    V<decltype(d)> x, y;
    const auto there = project(d, camera, at, levels + i, x, y);
    hn::StoreU(x, d, out_x + i);
    hn::StoreU(y, d, out_y + i);
    const auto ones = hn::ConvertTo(d32, hn::IfThenElseZero(there, hn::Set(d, 1.f)));
    hn::StoreU(hn::DemoteTo(d8, ones), d8, seen + i);
  });
}

void sums(const TrialProjection& camera, const TrialNodes& nodes, const TrialLuma& luma, const TrialSums* trials,
          int num_trials) {
  for_nodes(nodes, [&](auto d, int i, auto inside) HWY_ATTR {
    const auto at = look(d, camera, hn::LoadU(d, nodes.u + i), hn::LoadU(d, nodes.v + i));
    const auto weight = hn::IfThenElseZero(inside, hn::LoadU(d, nodes.weight + i));
    for (int t = 0; t < num_trials; t++) {
      V<decltype(d)> x, y;
      const auto seen = project(d, camera, at, trials[t].levels + i, x, y);
      // What is not seen may be NaN or anything: it samples the first value, with no weight.
      x = hn::IfThenElseZero(seen, hn::Sub(x, hn::Set(d, luma.left)));
      y = hn::IfThenElseZero(seen, hn::Sub(y, hn::Set(d, luma.top)));
      const auto w = hn::IfThenElseZero(seen, weight);
      const auto value = hn::ConvertTo(d, sample(d, luma, x, y));
      const auto weighted = hn::Mul(w, value);
      add_saturated(d, hn::Mul(w, hn::Set(d, Moments::kWeightOne)), trials[t].weight + i);
      add_saturated(d, hn::Mul(weighted, hn::Set(d, Moments::kLumaOne)), trials[t].luma + i);
      add_saturated(d, hn::Mul(weighted, value), trials[t].square + i);
    }
  });
}

void weights_of_run(const double edge[3], const double step[3], int corner, int n, float* HWY_RESTRICT out) {
  // The functions are linear and of one sign in the face: begun where it begins they keep float's precision.
  const auto sum = static_cast<float>(edge[0] + edge[1] + edge[2]);
  const auto sum_step = static_cast<float>(step[0] + step[1] + step[2]);
  const auto one = static_cast<float>(edge[corner]), one_step = static_cast<float>(step[corner]);
  for_lanes<float>(n, [&](auto d, int i) HWY_ATTR {
    const auto k = hn::Iota(d, static_cast<float>(i));
    const auto part = hn::MulAdd(k, hn::Set(d, one_step), hn::Set(d, one));
    const auto whole = hn::MulAdd(k, hn::Set(d, sum_step), hn::Set(d, sum));
    const auto weight = hn::Min(hn::Max(hn::Div(part, whole), hn::Zero(d)), hn::Set(d, 1.f));
    hn::StoreU(weight, d, out + i);
  });
}

}  // namespace lf::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lf {

HWY_EXPORT(positions);
HWY_EXPORT(sums);
HWY_EXPORT(weights_of_run);

void project_trial(const TrialProjection& projection, const TrialNodes& nodes, const uint8_t* levels, float* x,
                   float* y, uint8_t* seen) {
  HWY_DYNAMIC_DISPATCH(positions)(projection, nodes, levels, x, y, seen);
}

void add_trials(const TrialProjection& projection, const TrialNodes& nodes, const TrialLuma& luma,
                const TrialSums* trials, int num_trials) {
  HWY_DYNAMIC_DISPATCH(sums)(projection, nodes, luma, trials, num_trials);
}

void weigh_run(const double edge[3], const double step[3], int corner, int n, float* out) {
  HWY_DYNAMIC_DISPATCH(weights_of_run)(edge, step, corner, n, out);
}

}  // namespace lf
#endif
