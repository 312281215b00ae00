// SPDX-License-Identifier: LGPL-2.1-or-later
// Included once per instruction set, see render_band.cc: projects points of a view into one camera's image, and samples
// the image bilinearly. The fast functions read windows of image rows with vector loads. The slow functions gather
// single pixels. The terms are explained in sum_task.h.
#if defined(LF_RENDER_SIMD_SAMPLES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_RENDER_SIMD_SAMPLES_INL_H_
#undef LF_RENDER_SIMD_SAMPLES_INL_H_
#else
#define LF_RENDER_SIMD_SAMPLES_INL_H_
#endif

#include <algorithm>
#include <cstring>

#include <hwy/highway.h>

#include "geometry/distort-inl.h"
#include "render/simd/sum_task.h"
#include "render/sum_renderer.h"

HWY_BEFORE_NAMESPACE();
namespace lf::simd::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

inline constexpr float kMagic = 12582912;  // 1.5 * 2^23

// Rounds to the nearest integer, for |v| < 2^22. The result is in the low bits of each 32-bit lane, and the high bits
// are undefined. Adding kMagic leaves no fractional bits, which is cheaper than a conversion that must also handle
// values out of range.
template <class V>
HWY_INLINE auto to_low_bits(V v) {
  const hn::DFromV<V> d;
  return hn::BitCast(hn::RebindToUnsigned<decltype(d)>(), hn::Add(v, hn::Set(d, kMagic)));
}

// Rounds to the nearest integer modulo 2^16: correct for both int16_t and uint16_t.
template <class D16, class V>
HWY_INLINE auto to_fixed(D16, V v) {
  return hn::TruncateTo(hn::RebindToUnsigned<D16>(), to_low_bits(v));
}

// The weight of the second difference in Bessel's interpolation formula, at position t = 0..1 between two nodes.
constexpr float bessel(float t) { return t * (t - 1) / 4; }

// Projects pixels of a view into a camera's image, like CameraProjection::project() but in float and without the test
// whether the camera sees the point. `terms` must be linearised near the pixels, so that rounding errors stay small.
// Results are the position (x, y) in the image and, for the caller's test, the depth z up to a positive factor and the
// value `reach` that must not exceed Distortion::limit. For a fisheye lens, z is the distance instead; see
// through_lens().
struct Projection {
  Projection(const Slot& slot, const ProjectionTerms& terms) : slot(slot), terms(terms) {}
  // `i` and `j` are the columns and rows from the pixel around which the terms are linearised.
  template <class D, class V = hn::Vec<D>>
  HWY_INLINE void project(D d, V i, V j, V& x, V& y, V& z, V& reach) const {
    const auto at = [&](int k) HWY_ATTR {
      return hn::MulAdd(i, hn::Set(d, terms.along[k]),
                        hn::MulAdd(j, hn::Set(d, terms.down[k]), hn::Set(d, terms.from[k])));
    };
    finish(d, at(0), at(1), at(2), x, y, z, reach);
  }
  // Projects through a focal map. `s` are the inverse distances. Sets z to 0 for points behind the eye.
  template <class D, class V = hn::Vec<D>>
  HWY_INLINE void project(D d, V i, V j, V s, V& x, V& y, V& z, V& reach) const {
    const auto more = hn::Sub(s, hn::Set(d, static_cast<float>(terms.near)));
    const auto at = [&](int k) HWY_ATTR {
      const auto base = hn::MulAdd(i, hn::Set(d, terms.along[k]),
                                   hn::MulAdd(j, hn::Set(d, terms.down[k]), hn::Set(d, terms.from[k])));
      const auto per = hn::MulAdd(i, hn::Set(d, terms.per_along[k]),
                                  hn::MulAdd(j, hn::Set(d, terms.per_down[k]), hn::Set(d, terms.per_from[k])));
      return hn::MulAdd(more, per, base);
    };
    const auto before_eye = hn::NegMulAdd(s, hn::Set(d, slot.eye_distance), hn::Set(d, 1.f));
    finish(d, at(0), at(1), at(2), x, y, z, reach);
    z = hn::IfThenElseZero(hn::Gt(before_eye, hn::Set(d, 1e-6f)), z);
  }
  template <class D, class V = hn::Vec<D>>
  HWY_INLINE void finish(D d, V x_camera, V y_camera, V z_camera, V& x, V& y, V& z, V& reach) const {
    z = z_camera;
    reach = lf::HWY_NAMESPACE::through_lens<true>(d, slot.distortion, slot.is_distorted, x_camera, y_camera, z);
    x = hn::MulAdd(x_camera, hn::Set(d, slot.fx), hn::Set(d, slot.cx));
    y = hn::MulAdd(y_camera, hn::Set(d, slot.fy), hn::Set(d, slot.cy));
  }
  const Slot& slot;
  const ProjectionTerms& terms;
};

// The geometry of one plane of an image, for deciding which samples the fast path may read. Also the positions t of the
// last samples of a half-block and a block.
struct PlaneGeometry {
  float width, height;  // samples of the plane
  int32_t stride, pixel_bytes;
  float border_columns;                 // columns at the right border that the fast path must not read
  bool shuffles;                        // windows are possible: samples are adjacent bytes, and rows are wide enough
  bool slopes;                          // the lens bends rows so much that tall windows are worth their tests
  float t_before_half, t_half, t_last;  // t of samples 7, 8 and 15; chroma has a single half
};

inline constexpr int kWindow = 16;                           // bytes
inline constexpr float kSlack = 3.f / (1 << kPositionBits);  // pixels; largest difference of fixed point from float

// A bilinear sample needs two adjacent image rows. These constants are the number of rows of a window that can be the
// upper one, so a window has one row more. Two are mostly enough. If a focal map has a depth step inside the block, the
// samples spread over more rows. For a focal plane, a fisheye lens bends the rows of the view, so that the two halves
// of a block begin in different rows and need one row more.
inline constexpr int kFlatSteps = 2, kTallSteps = 7, kTallChromaSteps = 4, kSlopedSteps = 3;

// Largest third difference of the nodes that Bessel interpolation can interpolate with an error below kGridError. The
// first neglected term is t (t - 1) (t - 1/2) / 6 times the third difference, which is at most 0.0081 times the third
// difference.
inline constexpr float kLargestThird = static_cast<float>(kGridError / 0.0081);

inline PlaneGeometry luma_geometry(const Slot& slot, bool i420) {
  const ImageView& image = slot.image;
  return {.width = static_cast<float>(image.width),
          .height = static_cast<float>(image.height),
          .stride = static_cast<int32_t>(image.stride[0]),
          .pixel_bytes = i420 ? 1 : image.layout.pixel_stride,
          .border_columns = i420 ? 0.f : 1.f,
          .shuffles = i420 && image.width >= kWindow,
          .slopes = slot.distortion.is_general,
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
          .border_columns = 0,
          .shuffles = chroma_size(image.width) >= kWindow && image.stride[1] == image.stride[2],
          .slopes = slot.distortion.is_general,
          .t_before_half = 14.5f / kBlock,
          .t_half = 0,  // Cb and Cr have one half each
          .t_last = 14.5f / kBlock};
}

#if HWY_TARGET != HWY_SCALAR

using D16 = hn::CappedTag<int16_t, kBlock>;
using V16 = hn::Vec<D16>;
using DU16 = hn::RebindToUnsigned<D16>;

// Returns a + (b - a) f, where f in 0..1 has 15 fraction bits. a and b are levels times 128, so their difference fits
// in 16 bits.
HWY_INLINE V16 mix(V16 a, V16 b, V16 f) { return hn::Add(a, hn::MulFixedPoint15(hn::Sub(b, a), f)); }

// Constants for interpolating the positions of the 16 samples along a block: t and the Bessel weight of each sample, in
// fixed point.
struct UnitTable {
  alignas(64) uint16_t t16[kBlock];  // 65536 = 1
  alignas(64) int16_t t15[kBlock];   // 32768 = 1
  alignas(64) int16_t bessel15[kBlock];
  alignas(64) float x[kBlock];  // pixels from the block's left edge
};

constexpr UnitTable make_unit_table(bool chroma) {
  UnitTable table{};
  for (int i = 0; i < kBlock; i++) {
    const float x = chroma ? static_cast<float>(2 * (i % kChromaBlock)) + 0.5f : static_cast<float>(i), t = x / kBlock;
    table.t16[i] = static_cast<uint16_t>(t * 65536);
    table.t15[i] = static_cast<int16_t>(t * 32768);
    table.bessel15[i] = static_cast<int16_t>(bessel(t) * 32768 - 0.5f);  // never positive
    table.x[i] = x;
  }
  return table;
}
inline constexpr UnitTable kLumaTable = make_unit_table(false), kChromaTable = make_unit_table(true);

// Loads 16 bytes for each half of a vector of 16 samples. Shorter vectors load the half that contains `lane`.
HWY_INLINE auto load_windows(const uint8_t* low, const uint8_t* high, size_t lane) {
  const hn::Repartition<uint8_t, D16> d8;
  if constexpr (hn::MaxLanes(D16()) == kBlock) {
    const hn::Half<decltype(d8)> half;
    return hn::Combine(d8, hn::LoadU(half, high), hn::LoadU(half, low));
  } else {
    return hn::LoadU(d8, lane < kChromaBlock ? low : high);
  }
}

// Returns a vector with one value for the first half of a block and another value for the second half.
HWY_INLINE auto by_half(uint16_t low, uint16_t high, size_t lane) {
  const DU16 d;
  if constexpr (hn::MaxLanes(D16()) == kBlock)
    return hn::ConcatUpperLower(d, hn::Set(d, high), hn::Set(d, low));
  else
    return hn::Set(d, lane < kChromaBlock ? low : high);
}

using VU16 = hn::Vec<DU16>;

// Returns a (1 - f) + b f, where f in 0..1 has 16 fraction bits. `rest` is the bitwise complement of f.
HWY_INLINE VU16 blend(VU16 a, VU16 b, VU16 rest, VU16 f) { return hn::Add(hn::MulHigh(a, rest), hn::MulHigh(b, f)); }

// The fixed-point arithmetic of sample_windows() truncates. Its results, with 256 units per level, are too small by
// this value on average, and at most by twice this value.
inline constexpr int kCutOff = 3;

// Samples one row of a block, for the lanes of a vector that begins at sample `lane`. Returns levels times 256, minus
// kCutOff on average. `low` and `high` point to the windows of the two half-blocks, and all samples must be inside
// these windows. `x` and `y` are positions relative to the windows, in fixed point (kPositionBits). kSteps is the
// number of rows that can be the upper row of a sample.
template <int kSteps>
HWY_INLINE VU16 sample_windows(VU16 x, V16 y, const uint8_t* low, const uint8_t* high, ptrdiff_t stride, size_t lane) {
  const D16 d;
  const DU16 du;
  const hn::Repartition<uint8_t, D16> d8;
  constexpr int kToFraction16 = 16 - kPositionBits;
  const auto fx = hn::ShiftLeft<kToFraction16>(x), fy = hn::BitCast(du, hn::ShiftLeft<kToFraction16>(y));
  const auto rest_x = hn::Not(fx), rest_y = hn::Not(fy);
  // Bytes of a 16-bit lane: a sample and its right neighbour.
  const auto index = hn::ShiftRight<kPositionBits>(x);
  const auto pick = hn::BitCast(d8, hn::Add(hn::Or(index, hn::ShiftLeft<8>(index)), hn::Set(du, 0x0100)));
  const auto pairs = [&](ptrdiff_t row) HWY_ATTR {
    return hn::BitCast(du, hn::TableLookupBytes(load_windows(low + row * stride, high + row * stride, lane), pick));
  };
  // Always reading all rows is faster than a branch.
  auto upper = pairs(0), lower = pairs(1), last = lower;
  HWY_UNROLL(kTallSteps)
  for (int r = 1; r < kSteps; r++) {
    const auto below = hn::RebindMask(du, hn::Gt(y, hn::Set(d, static_cast<int16_t>((r << kPositionBits) - 1))));
    const auto next = pairs(r + 1);
    upper = hn::IfThenElse(below, last, upper);
    lower = hn::IfThenElse(below, next, lower);
    last = next;
  }
  const auto across = [&](VU16 pair) HWY_ATTR {
    return blend(hn::ShiftLeft<8>(pair), hn::And(pair, hn::Set(du, 0xff00)), rest_x, fx);
  };
  return blend(across(upper), across(lower), rest_y, fy);
}

// The positions of samples relative to their windows, in fixed point (kPositionBits).
struct FixedPositions {
  V16 x, y;
};

// Interpolates the positions of the samples of one row of a block, from `lane` on, for a focal plane. See
// WindowPositions. kTall: the windows of the halves may begin in different rows.
template <bool kTall>
HWY_INLINE FixedPositions plane_between(const WindowPositions& at, const UnitTable& table, size_t lane) {
  const D16 d;
  const DU16 du;
  const auto bend = hn::Load(d, table.bessel15 + lane);
  const auto along = hn::Add(hn::MulHigh(hn::Set(du, at.dx), hn::Load(du, table.t16 + lane)),
                             hn::BitCast(du, hn::MulFixedPoint15(hn::Set(d, at.sx), bend)));
  const auto x = hn::Add(by_half(at.x0, at.x0_half, lane), along);
  auto y0 = hn::Set(d, at.y0);
  if constexpr (kTall) {
    const auto y0_half = static_cast<uint16_t>(at.y0 - at.rows_to_half() * (1 << kPositionBits));
    y0 = hn::BitCast(d, by_half(static_cast<uint16_t>(at.y0), y0_half, lane));
  }
  const auto y = hn::Add(hn::Add(y0, hn::MulFixedPoint15(hn::Set(d, at.sy), bend)),
                         hn::MulFixedPoint15(hn::Set(d, at.dy), hn::Load(d, table.t15 + lane)));
  return {hn::BitCast(d, x), y};
}

// The positions of all samples in one row of a block, as integer part (column, row) and 15-bit fraction (fx, fy). They
// are positions in the image plane or, if `corner` is set, relative to the window of each half-block.
struct Positions {
  alignas(64) int32_t column[kBlock], row[kBlock];
  alignas(64) int16_t fx[kBlock], fy[kBlock];
  int32_t corner[2] = {};  // byte offsets of the halves' windows in the plane
};

// Splits positions into an integer part and a 15-bit fraction. The integer part is at most `largest`, so that the
// neighbour that interpolation needs exists.
template <class D, class V = hn::Vec<D>>
HWY_INLINE void split(D d, V v, V largest, int32_t* whole, int16_t* fraction) {
  const hn::RebindToSigned<D> di;
  const hn::Rebind<int16_t, D> d16;
  const auto floor = hn::Min(hn::Floor(v), largest);
  hn::Store(hn::ConvertTo(di, floor), di, whole);
  const auto f = hn::Min(hn::Mul(hn::Sub(v, floor), hn::Set(d, 32768.f)), hn::Set(d, 32767.f));
  hn::Store(hn::BitCast(d16, to_fixed(d16, f)), d16, fraction);
}

// Interpolates the positions of the samples of one row of a block from the nodes, for a focal plane. `i` is the index
// of the block in `at`.
inline void interpolate_positions(const PlanePositions& at, int i, const UnitTable& table, Positions& out) {
  const hn::CappedTag<float, kBlock> d;
  const auto along = [&](const std::vector<float>& node, size_t lane) HWY_ATTR {
    const float *n = node.data() + i, delta = n[2] - n[1], second = (n[3] - n[2]) - (n[1] - n[0]);
    const auto t = hn::Mul(hn::Load(d, table.x + lane), hn::Set(d, 1.f / kBlock));
    const auto b = hn::Mul(hn::Mul(t, hn::Sub(t, hn::Set(d, 1.f))), hn::Set(d, 0.25f * second));
    return hn::Add(hn::MulAdd(t, hn::Set(d, delta), hn::Set(d, n[1])), b);
  };
  for (size_t lane = 0; lane < kBlock; lane += hn::Lanes(d)) {
    split(d, along(at.node_x, lane), hn::Set(d, 1e9f), out.column + lane, out.fx + lane);
    split(d, along(at.node_y, lane), hn::Set(d, 1e9f), out.row + lane, out.fy + lane);
  }
}

// Says whether the camera sees all samples with a weight. kUnknown means that rounding of float could change the
// answer for a sample.
enum class Visibility { kAll, kSome, kUnknown };

// Projects each sample in one row of a block, of luma, RGB or chroma, and clamps the positions to the image. This is
// the slow path, for blocks with samples at the border of the image or behind the camera.
//
// `x` and `y` are the offset, in pixels of the view, from the pixel of `terms` to the left edge of the block and to the
// row. `inverse` contains the inverse distances of the focal map at the samples: kBlock values, or twice the same kHalf
// values for chroma. It is null without a map. The weights of samples that the camera does not see are moved from
// `weight` to `lost`. The arrays have kBlock values. They are null for chroma, which is visible where its pixels are
// visible.
//
// If the result is kUnknown, `weight` and `lost` are unchanged: rounding could decide whether a sample is visible, or
// a sample cannot be read with vector loads.
inline Visibility project_positions(const SumTask& task, const Slot& slot, const ProjectionTerms& terms, bool chroma,
                                    float x, float y, const UnitTable& table, const float* inverse, int16_t* weight,
                                    int16_t* lost, Positions& out) {
  const hn::CappedTag<float, kBlock> d;
  const hn::RebindToSigned<decltype(d)> di;
  const hn::Rebind<int16_t, decltype(d)> d16;
  const Projection projection(slot, terms);
  const float width = static_cast<float>(chroma ? chroma_size(slot.image.width) : slot.image.width);
  const float height = static_cast<float>(chroma ? chroma_size(slot.image.height) : slot.image.height);
  if (width < 2 || height < 2) return Visibility::kUnknown;
  const auto set = [&](float v) HWY_ATTR { return hn::Set(d, v); };
  constexpr float kUndecided = 1.f / 128;  // pixels; far above the rounding of float
  bool undecided = false, all = true;
  alignas(64) int16_t seen_weight[kBlock] = {}, missing_weight[kBlock] = {};
  for (size_t lane = 0; lane < kBlock; lane += hn::Lanes(d)) {
    hn::Vec<decltype(d)> px, py, z, reach;
    const auto column = hn::Add(hn::Load(d, table.x + lane), set(x)), row = set(y);
    if (inverse)
      projection.project(d, column, row, hn::LoadU(d, inverse + lane), px, py, z, reach);
    else
      projection.project(d, column, row, px, py, z, reach);
    const auto in_front = hn::And(hn::Gt(z, hn::Zero(d)), hn::Le(reach, set(slot.distortion.limit)));
    if (weight) {
      // distance inside the image; negative outside
      const auto depth = hn::Min(hn::Min(hn::Add(px, set(0.5f)), hn::Sub(set(width - 0.5f), px)),
                                 hn::Min(hn::Add(py, set(0.5f)), hn::Sub(set(height - 0.5f), py)));
      const auto w = hn::PromoteTo(di, hn::Load(d16, weight + lane));
      const auto weighs = hn::RebindMask(d, hn::Gt(w, hn::Zero(di)));
      const auto seen = hn::And(in_front, hn::Gt(depth, hn::Zero(d)));
      // Near the eye's plane, the lens's fold and the border, float cannot decide, so these samples are computed in
      // double.
      const auto to_fold = hn::Abs(hn::Sub(reach, set(slot.distortion.limit)));
      const auto clear = hn::And(
          hn::Gt(hn::Abs(depth), set(kUndecided)),
          hn::And(hn::Gt(hn::Abs(z), set(1e-3f)), hn::Gt(to_fold, set(1e-3f * std::min(slot.distortion.limit, 1e3f)))));
      undecided = undecided || !hn::AllFalse(d, hn::AndNot(clear, weighs));
      const auto w_seen = hn::IfThenElseZero(hn::RebindMask(di, seen), w);
      hn::Store(hn::DemoteTo(d16, w_seen), d16, seen_weight + lane);
      hn::Store(hn::DemoteTo(d16, hn::Sub(w, w_seen)), d16, missing_weight + lane);
      all = all && hn::AllFalse(d, hn::AndNot(seen, weighs));
    } else {
      px = hn::Mul(hn::Sub(px, set(0.5f)), set(0.5f));
      py = hn::Mul(hn::Sub(py, set(0.5f)), set(0.5f));
      // A chroma sample may lie behind the camera although some of its pixels are in front.
      undecided = undecided || !hn::AllTrue(d, in_front);
    }
    // Samples that are not in front have no weight, so any position will do.
    const auto good = hn::And(in_front, hn::And(hn::Eq(px, px), hn::Eq(py, py)));
    const auto limited = [&](const auto v, float largest) HWY_ATTR {
      return hn::IfThenElseZero(good, hn::Max(hn::Min(v, set(largest)), hn::Zero(d)));
    };
    split(d, limited(px, width - 1), set(width - 2), out.column + lane, out.fx + lane);
    split(d, limited(py, height - 1), set(height - 2), out.row + lane, out.fy + lane);
  }
  // The bytes after the last pixel are outside the buffer if pixels have three bytes.
  if (task.family == PixelFamily::kRgb && slot.image.layout.pixel_stride < 4)
    for (int i = 0; i < kBlock; i++)
      undecided = undecided || (out.row[i] + 2 >= slot.image.height && out.column[i] + 2 >= slot.image.width);
  if (undecided) return Visibility::kUnknown;
  if (weight && !all) {
    std::copy_n(seen_weight, kBlock, weight);
    std::copy_n(missing_weight, kBlock, lost);
  }
  return all ? Visibility::kAll : Visibility::kSome;
}

// Gathers and interpolates 16 samples of planes with one byte per sample. The two half-blocks may read different
// planes, such as Cb and Cr. Returns levels times 128.
HWY_INLINE void gather_bytes(const Positions& at, const uint8_t* low, const uint8_t* high, ptrdiff_t low_stride,
                             ptrdiff_t high_stride, int16_t* out) {
  alignas(64) uint16_t upper[kBlock], lower[kBlock];
  for (int i = 0; i < kBlock; i++) {
    const ptrdiff_t stride = i < kChromaBlock ? low_stride : high_stride;
    const uint8_t* from = (i < kHalf ? low + at.corner[0] : high + at.corner[1]) + at.row[i] * stride + at.column[i];
    std::memcpy(&upper[i], from, 2);
    std::memcpy(&lower[i], from + stride, 2);
  }
  const D16 d;
  const DU16 du;
  for (size_t lane = 0; lane < kBlock; lane += hn::Lanes(d)) {
    const auto fx = hn::Load(d, at.fx + lane), fy = hn::Load(d, at.fy + lane);
    const auto across = [&](const uint16_t* pairs) HWY_ATTR {
      const auto v = hn::Load(du, pairs + lane);
      return mix(hn::BitCast(d, hn::ShiftRight<1>(hn::ShiftLeft<8>(v))),
                 hn::BitCast(d, hn::And(hn::ShiftRight<1>(v), hn::Set(du, 0x7f80))), fx);
    };
    hn::Store(mix(across(upper), across(lower), fy), d, out + lane);
  }
}

// Separates 16 pixels of R, G, B and an unused value into planes.
HWY_INLINE void part_colours(const int16_t* pixels, int16_t out[3][kBlock]) {
  const D16 d;
  for (size_t i = 0; i < kBlock; i += hn::Lanes(d)) {
    V16 r, g, b, rest;
    hn::LoadInterleaved4(d, pixels + 4 * i, r, g, b, rest);
    hn::Store(r, d, out[0] + i);
    hn::Store(g, d, out[1] + i);
    hn::Store(b, d, out[2] + i);
  }
}

// Gathers and interpolates 16 samples of R, G and B. Returns levels times 128.
HWY_INLINE void gather_pixels(const Positions& at, const Slot& slot, int16_t out[3][kBlock]) {
  const uint8_t* const plane = slot.image.plane[0];
  const ptrdiff_t stride = slot.image.stride[0], pixel_stride = slot.image.layout.pixel_stride;
  alignas(64) uint64_t upper[kBlock], lower[kBlock], fx[kBlock], fy[kBlock];
  constexpr uint64_t kSpread = 0x0001000100010001;
  for (int i = 0; i < kBlock; i++) {
    const uint8_t* from = plane + at.corner[i / kHalf] + at.row[i] * stride + at.column[i] * pixel_stride;
    std::memcpy(&upper[i], from, 8);
    std::memcpy(&lower[i], from + stride, 8);
    fx[i] = static_cast<uint16_t>(at.fx[i]) * kSpread;
    fy[i] = static_cast<uint16_t>(at.fy[i]) * kSpread;
  }
  const D16 d;
  const DU16 du;
  const hn::Repartition<uint8_t, D16> d8;
  const hn::Repartition<uint64_t, D16> d64;
  const auto bytes = hn::LoadDup128(d8, slot.pixel_pairs);
  alignas(64) int16_t mixed[4 * kBlock];
  for (size_t i = 0; i < kBlock; i += hn::Lanes(d64)) {
    const auto x = hn::BitCast(d, hn::Load(d64, fx + i)), y = hn::BitCast(d, hn::Load(d64, fy + i));
    const auto across = [&](const uint64_t* pairs) HWY_ATTR {
      const auto v = hn::BitCast(du, hn::TableLookupBytesOr0(hn::BitCast(d8, hn::Load(d64, pairs + i)), bytes));
      return mix(hn::BitCast(d, hn::ShiftRight<1>(hn::ShiftLeft<8>(v))),
                 hn::BitCast(d, hn::And(hn::ShiftRight<1>(v), hn::Set(du, 0x7f80))), x);
    };
    hn::Store(mix(across(upper), across(lower), y), d, mixed + 4 * i);
  }
  part_colours(mixed, out);
}

#endif

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
