// SPDX-License-Identifier: LGPL-2.1-or-later
// Per target, see render_band.cc: where points of a view are in one camera's image, and its planes.
#if defined(LF_RENDER_SIMD_POSITIONS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_RENDER_SIMD_POSITIONS_INL_H_
#undef LF_RENDER_SIMD_POSITIONS_INL_H_
#else
#define LF_RENDER_SIMD_POSITIONS_INL_H_
#endif

#include <hwy/highway.h>

#include "render/simd/band_data.h"
#include "render/sum_renderer.h"

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

// The nearest integer modulo 2^16: right for int16_t and uint16_t alike.
template <class D16, class V>
HWY_INLINE auto to_fixed(D16, V v) {
  return hn::TruncateTo(hn::RebindToUnsigned<D16>(), to_low_bits(v));
}

// Bessel's second-difference weight, t (t - 1) / 4.
constexpr float bessel(float t) { return t * (t - 1) / 4; }

// Projects points near where its terms are from: CameraProjection::project() in float, without its verdict on what is
// lost. Rounding stays small because what is linear in the view starts from double precision near the points.
struct Projection {
  Projection(const Slot& slot, const ProjectionTerms& terms) : slot(slot), terms(terms) {}
  // `i`, `j`: columns and rows from the place that the terms are of.
  template <class D, class V = hn::Vec<D>>
  HWY_INLINE void project(D d, V i, V j, V& x, V& y, V& z, V& r2) const {
    const auto at = [&](int k) HWY_ATTR {
      return hn::MulAdd(i, hn::Set(d, terms.along[k]),
                        hn::MulAdd(j, hn::Set(d, terms.down[k]), hn::Set(d, terms.from[k])));
    };
    finish(d, at(0), at(1), at(2), x, y, z, r2);
  }
  // Projects with a focal map: `s` are inverse distances. What is not in front of the eye has z = 0.
  template <class D, class V = hn::Vec<D>>
  HWY_INLINE void project(D d, V i, V j, V s, V& x, V& y, V& z, V& r2) const {
    const auto more = hn::Sub(s, hn::Set(d, static_cast<float>(terms.near)));
    const auto at = [&](int k) HWY_ATTR {
      const auto base = hn::MulAdd(i, hn::Set(d, terms.along[k]),
                                   hn::MulAdd(j, hn::Set(d, terms.down[k]), hn::Set(d, terms.from[k])));
      const auto per = hn::MulAdd(i, hn::Set(d, terms.per_along[k]),
                                  hn::MulAdd(j, hn::Set(d, terms.per_down[k]), hn::Set(d, terms.per_from[k])));
      return hn::MulAdd(more, per, base);
    };
    const auto before_eye = hn::NegMulAdd(s, hn::Set(d, slot.eye_distance), hn::Set(d, 1.f));
    finish(d, at(0), at(1), hn::IfThenElseZero(hn::Gt(before_eye, hn::Set(d, 1e-6f)), at(2)), x, y, z, r2);
  }
  template <class D, class V = hn::Vec<D>>
  HWY_INLINE void finish(D d, V x_camera, V y_camera, V z_camera, V& x, V& y, V& z, V& r2) const {
    z = z_camera;
    const auto inverse = hn::Div(hn::Set(d, 1.f), z);
    const auto u = hn::Mul(x_camera, inverse), v = hn::Mul(y_camera, inverse);
    auto du = u, dv = v;
    r2 = hn::MulAdd(u, u, hn::Mul(v, v));
    if (slot.radial) {
      const auto stretch = hn::MulAdd(r2, hn::MulAdd(r2, hn::Set(d, slot.k2), hn::Set(d, slot.k1)), hn::Set(d, 1.f));
      du = hn::Mul(u, stretch);
      dv = hn::Mul(v, stretch);
      if (slot.tangential) {
        const auto two_uv = hn::Mul(hn::Add(u, u), v), p1 = hn::Set(d, slot.p1), p2 = hn::Set(d, slot.p2);
        du = hn::MulAdd(p2, hn::MulAdd(hn::Add(u, u), u, r2), hn::MulAdd(p1, two_uv, du));
        dv = hn::MulAdd(p1, hn::MulAdd(hn::Add(v, v), v, r2), hn::MulAdd(p2, two_uv, dv));
      }
    }
    x = hn::MulAdd(du, hn::Set(d, slot.fx), hn::Set(d, slot.cx));
    y = hn::MulAdd(dv, hn::Set(d, slot.fy), hn::Set(d, slot.cy));
  }
  const Slot& slot;
  const ProjectionTerms& terms;
};

// The geometry of one plane of an image, and where along a block its samples are.
struct PlaneGeometry {
  float width, height;  // samples of the plane
  int32_t stride, pixel_bytes;
  float spare_columns;                  // columns on the right that are left to the slow way
  bool shuffles;                        // samples are bytes side by side, and rows have at least a window
  float t_before_half, t_half, t_last;  // t of samples 7, 8 and 15, or of the last one of the only half
};

inline constexpr int kWindow = 16;                           // bytes
inline constexpr float kSlack = 3.f / (1 << kPositionBits);  // pixels by which fixed point may differ from float

// The next term of the interpolation is t (t - 1) (t - 1/2) / 6 of the third difference: 0.0081 of it at most.
inline constexpr float kLargestThird = static_cast<float>(kGridError / 0.0081);

inline PlaneGeometry luma_geometry(const Slot& slot, bool i420) {
  const ImageView& image = slot.image;
  return {.width = static_cast<float>(image.width),
          .height = static_cast<float>(image.height),
          .stride = static_cast<int32_t>(image.stride[0]),
          .pixel_bytes = i420 ? 1 : image.layout.pixel_stride,
          .spare_columns = i420 ? 0.f : 1.f,
          .shuffles = i420 && image.width >= kWindow,
          .t_before_half = 7.f / kBlock,
          .t_half = 8.f / kBlock,
          .t_last = 15.f / kBlock};
}

inline PlaneGeometry chroma_geometry(const Slot& slot) {
  const ImageView& image = slot.image;
  return {.width = static_cast<float>(chroma_size(image.width)),
          .height = static_cast<float>(chroma_size(image.height)),
          .stride = static_cast<int32_t>(image.stride[1]),
          .pixel_bytes = 1,
          .spare_columns = 0,
          .shuffles = chroma_size(image.width) >= kWindow && image.stride[1] == image.stride[2],
          .t_before_half = 14.5f / kBlock,
          .t_half = 0,  // Cb and Cr have a half each
          .t_last = 14.5f / kBlock};
}

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
