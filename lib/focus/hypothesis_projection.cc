// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/hypothesis_projection.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "focus/hypothesis_projection.cc"
#include <hwy/foreach_target.h>  // must precede highway.h
#include <hwy/highway.h>

#include "base/for_lanes-inl.h"
#include "geometry/distort-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lf::HWY_NAMESPACE {

template <class D>
using V = hn::Vec<D>;

template <class D>
struct CameraVectors {
  V<D> base[3], slope[3];  // camera coordinates
};

template <class D>
HWY_INLINE CameraVectors<D> look(D d, const HypothesisProjection& camera, V<D> u, V<D> v) {
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

// Does the same as CameraProjection::project(): computes the position in the image, and returns the visibility.
template <class D>
HWY_INLINE auto project(D d, const HypothesisProjection& camera, const CameraVectors<D>& at, const uint8_t* levels,
                        V<D>& x, V<D>& y) {
  const hn::Rebind<uint8_t, D> d8;
  const hn::Rebind<int32_t, D> d32;
  const auto level = hn::ConvertTo(d, hn::PromoteTo(d32, hn::LoadU(d8, levels)));
  const auto inverse = hn::MulAdd(level, hn::Set(d, camera.per_level), hn::Set(d, camera.farthest));
  const auto eye = hn::Set(d, camera.eye_distance);
  const auto one = hn::Set(d, 1.f), half = hn::Set(d, -0.5f), zero = hn::Zero(d);
  const auto at_depth = [&](int k) HWY_ATTR { return hn::MulAdd(inverse, at.slope[k], at.base[k]); };
  auto u = at_depth(0), v = at_depth(1), z = at_depth(2);
  const auto reach = through_lens<true>(d, camera.distortion, camera.is_distorted, u, v, z);
  auto seen = hn::And(hn::Gt(z, zero), hn::Lt(hn::Mul(inverse, eye), one));
  if (camera.is_distorted) seen = hn::And(seen, hn::Le(reach, hn::Set(d, camera.distortion.limit)));
  x = hn::MulAdd(u, hn::Set(d, camera.fx), hn::Set(d, camera.cx));
  y = hn::MulAdd(v, hn::Set(d, camera.fy), hn::Set(d, camera.cy));
  seen = hn::And(seen, hn::And(hn::Ge(x, half), hn::Le(x, hn::Add(hn::Set(d, camera.width), half))));
  return hn::And(seen, hn::And(hn::Ge(y, half), hn::Le(y, hn::Add(hn::Set(d, camera.height), half))));
}

void positions(const HypothesisProjection& camera, const HypothesisRays& rays, const uint8_t* HWY_RESTRICT levels,
               float* HWY_RESTRICT out_x, float* HWY_RESTRICT out_y, uint8_t* HWY_RESTRICT seen) {
  map_lanes<float>(rays.count, [&](auto d, int i) HWY_ATTR {
    const hn::Rebind<uint8_t, decltype(d)> d8;
    const hn::Rebind<int32_t, decltype(d)> d32;
    const auto at = look(d, camera, hn::LoadU(d, rays.u + i), hn::LoadU(d, rays.v + i));
    V<decltype(d)> x, y;
    const auto there = project(d, camera, at, levels + i, x, y);
    hn::StoreU(x, d, out_x + i);
    hn::StoreU(y, d, out_y + i);
    const auto ones = hn::ConvertTo(d32, hn::IfThenElseZero(there, hn::Set(d, 1.f)));
    hn::StoreU(hn::DemoteTo(d8, ones), d8, seen + i);
  });
}

PlaceBounds places(const HypothesisProjection& camera, const HypothesisRays& rays, const uint8_t* HWY_RESTRICT levels,
                   int num_hypotheses, int32_t* HWY_RESTRICT out_x, int32_t* HWY_RESTRICT out_y) {
  const hn::CappedTag<float, kHypothesisPadding> d;
  const hn::Rebind<int32_t, decltype(d)> d32;
  const auto none = hn::Set(d32, -1), never = hn::Set(d32, INT32_MAX);
  auto left = never, top = never, right = none, bottom = none;
  const auto count = hn::Set(d32, rays.count);
  const ptrdiff_t stride = ptrdiff_t{rays.count} + static_cast<ptrdiff_t>(kHypothesisPadding);
  for (int i = 0; i < rays.count; i += static_cast<int>(hn::Lanes(d))) {
    const auto at = look(d, camera, hn::LoadU(d, rays.u + i), hn::LoadU(d, rays.v + i));
    const auto meant = hn::Lt(hn::Iota(d32, i), count);
    for (int t = 0; t < num_hypotheses; t++) {
      const ptrdiff_t place = t * stride + i;
      V<decltype(d)> x, y;
      const auto there = project(d, camera, at, levels + place, x, y);
      const auto seen = hn::And(hn::RebindMask(d32, there), meant);
      // Value (0, 0) belongs to (1/2, 1/2).
      const auto fixed = [&](V<decltype(d)> position, float size) HWY_ATTR {
        const auto from_first = hn::Max(hn::Sub(position, hn::Set(d, 0.5f)), hn::Zero(d));
        return hn::ConvertTo(d32, hn::Mul(hn::Min(from_first, hn::Set(d, size - 1)), hn::Set(d, 256.f)));
      };
      const auto fx = hn::IfThenElse(seen, fixed(x, camera.width), none);
      const auto fy = hn::IfThenElse(seen, fixed(y, camera.height), none);
      left = hn::Min(left, hn::IfThenElse(seen, fx, never));
      top = hn::Min(top, hn::IfThenElse(seen, fy, never));
      right = hn::Max(right, fx);
      bottom = hn::Max(bottom, fy);
      hn::StoreU(fx, d32, out_x + place);
      hn::StoreU(fy, d32, out_y + place);
    }
  }
  return {hn::GetLane(hn::MinOfLanes(d32, left)), hn::GetLane(hn::MinOfLanes(d32, top)),
          hn::GetLane(hn::MaxOfLanes(d32, right)), hn::GetLane(hn::MaxOfLanes(d32, bottom))};
}

void weights_of_run(const double edge[3], const double step[3], int corner, int n, float* HWY_RESTRICT out) {
  // The functions are linear and keep their sign inside the face. Counting from the first node keeps the numbers small
  // enough for float.
  const auto sum = static_cast<float>(edge[0] + edge[1] + edge[2]);
  const auto sum_step = static_cast<float>(step[0] + step[1] + step[2]);
  const auto one = static_cast<float>(edge[corner]), one_step = static_cast<float>(step[corner]);
  const hn::CappedTag<float, 8> d;  // runs are short
  for (int i = 0; i < n; i += static_cast<int>(hn::Lanes(d))) {
    const auto k = hn::Iota(d, static_cast<float>(i));
    const auto part = hn::MulAdd(k, hn::Set(d, one_step), hn::Set(d, one));
    const auto whole = hn::MulAdd(k, hn::Set(d, sum_step), hn::Set(d, sum));
    const auto weight = hn::Min(hn::Max(hn::Div(part, whole), hn::Zero(d)), hn::Set(d, 1.f));
    hn::StoreU(weight, d, out + i);
  }
}

}  // namespace lf::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lf {

HWY_EXPORT(positions);
HWY_EXPORT(places);
HWY_EXPORT(weights_of_run);

void project_hypothesis(const HypothesisProjection& projection, const HypothesisRays& rays, const uint8_t* levels,
                        float* x, float* y, uint8_t* seen) {
  HWY_DYNAMIC_DISPATCH(positions)(projection, rays, levels, x, y, seen);
}

PlaceBounds place_hypotheses(const HypothesisProjection& projection, const HypothesisRays& rays, const uint8_t* levels,
                             int num_hypotheses, int32_t* x, int32_t* y) {
  return HWY_DYNAMIC_DISPATCH(places)(projection, rays, levels, num_hypotheses, x, y);
}

void weigh_run(const double edge[3], const double step[3], int corner, int n, float* out) {
  HWY_DYNAMIC_DISPATCH(weights_of_run)(edge, step, corner, n, out);
}

}  // namespace lf
#endif
