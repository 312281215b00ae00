// SPDX-License-Identifier: LGPL-2.1-or-later
// Per target, see render_band.cc: the sum over those cameras of one block whose samples are shuffled from windows.
#if defined(LF_RENDER_SIMD_SUMS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_RENDER_SIMD_SUMS_INL_H_
#undef LF_RENDER_SIMD_SUMS_INL_H_
#else
#define LF_RENDER_SIMD_SUMS_INL_H_
#endif

#include <algorithm>
#include <type_traits>

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include "render/simd/band_data.h"
#if HWY_TARGET != HWY_SCALAR
#include "render/simd/cell_samples-inl.h"
#include "render/simd/samples-inl.h"
#endif

HWY_BEFORE_NAMESPACE();
namespace lf::simd::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// One camera in one block of a band.
struct Part {
  const BlockWeights* weights;
  const SlotBand* band;
  int32_t block;    // among the band's
  int32_t verdict;  // SlotBand::Verdict of the pair of rows
};

// A pair of rows of a block.
struct PairPlace {
  int pair;  // number of the pair in the band
  int x, y;  // the block's and the band's first pixel
  int out;   // the block's number in scratch
};

#if HWY_TARGET == HWY_SCALAR

template <bool kSurface, bool kFlat>
inline void sum_i420(const Part*, int, const PairPlace& at, Scratch& scratch) {
  for (int r = 2 * at.pair; r < 2 * at.pair + 2; r++) std::fill_n(scratch.sum[r][0] + at.out * kBlock, kBlock, 0);
  for (int c = 1; c < 3; c++) std::fill_n(scratch.sum[at.pair][c] + at.out * kChromaBlock, kChromaBlock, 0);
}

#else

// The weight of chroma: the mean of its four pixels', 2^kBits = 1, for both planes. `upper`, `lower`: two rows of
// weights.
template <int kBits>
HWY_INLINE V16 chroma_weights(const int16_t* upper, const int16_t* lower) {
  constexpr int kShift = 17 - kBits;  // takes the sum of four to their mean
  const D16 d;
  const DU16 du;
  const hn::Repartition<uint32_t, D16> d32;
  const auto half = [&](size_t i) HWY_ATTR {  // means of as many samples as a vector has 32-bit lanes
    const auto rows = hn::Add(hn::BitCast(du, hn::Load(d, upper + i)), hn::BitCast(du, hn::Load(d, lower + i)));
    const auto v = hn::BitCast(d32, rows);
    const auto sum = hn::Add(hn::And(v, hn::Set(d32, 0xffff)), hn::ShiftRight<16>(v));
    return hn::DemoteTo(hn::Rebind<int16_t, decltype(d32)>(),
                        hn::BitCast(hn::RebindToSigned<decltype(d32)>(),
                                    hn::ShiftRight<kShift>(hn::Add(sum, hn::Set(d32, 1 << (kShift - 1))))));
  };
  if constexpr (hn::MaxLanes(D16()) == kBlock) {
    const auto all = half(0);
    return hn::Combine(d, all, all);
  } else {
    return hn::Combine(d, half(kChromaBlock), half(0));
  }
}

// Chroma without its offset, times its weight.
HWY_INLINE V16 weigh_chroma(V16 samples, V16 weights) {
  return hn::MulFixedPoint15(hn::Sub(samples, hn::Set(D16(), 128 << kSumFractionBits)), weights);
}

// Rows that are prefetched ahead: cameras' rows are too far apart for the machine to see a pattern.
inline constexpr int kPrefetchRows = 8;

// The weighted samples of a part's pair of rows, lane..: two rows of luma, and chroma.
struct WeightedPair {
  V16 upper, lower, chroma;
};
template <bool kSurface, bool kTall>
HWY_INLINE WeightedPair weigh_windows(const Part& part, int pair, size_t lane) {
  const D16 d;
  const SlotBand& band = *part.band;
  const ImageView& image = band.slot->image;
  const int upper = 2 * pair, lower = upper + 1;
  const BlockWeights& weights = *part.weights;
  const ptrdiff_t stride = image.stride[0], chroma_stride = image.stride[1];
  // Finds where the windows of luma's halves begin, row by row, and those of chroma.
  const SurfaceBand& cells = band.surface;
  const ptrdiff_t entry = upper * band.pitch + part.block, chroma_entry = pair * band.pitch + part.block;
  const ptrdiff_t cell = upper * ptrdiff_t{cells.pitch} + 2 * part.block,
                  chroma_cell = pair * ptrdiff_t{cells.pitch} / 2 + part.block;
  const auto luma_at = [&](int row, int half) HWY_ATTR {
    if constexpr (kSurface) return image.plane[0] + cells.luma_corner[cell + row * ptrdiff_t{cells.pitch} + half];
    const ptrdiff_t at = entry + row * band.pitch;
    return image.plane[0] + band.luma.corner[at] + (half ? band.luma.window[at].half : 0);
  };
  const int32_t chroma_corner = kSurface ? cells.chroma_corner[chroma_cell] : band.chroma.corner[chroma_entry];
  const uint8_t *const y0 = luma_at(0, 0), *const y1 = luma_at(1, 0);
  const uint8_t *const cb = image.plane[1] + chroma_corner, *const cr = image.plane[2] + chroma_corner;
  hwy::Prefetch(y0 + kPrefetchRows * stride);
  hwy::Prefetch(y1 + kPrefetchRows * stride);
  hwy::Prefetch(cb + kPrefetchRows / 2 * chroma_stride);
  hwy::Prefetch(cr + kPrefetchRows / 2 * chroma_stride);
  const auto sample = [&](auto steps, const FixedPositions& at, const uint8_t* low, const uint8_t* high,
                          ptrdiff_t step) HWY_ATTR {
    return sample_windows<decltype(steps)::value>(hn::BitCast(DU16(), at.x), at.y, low, high, step, lane);
  };
  constexpr std::integral_constant<int, kTall ? kTallSteps : kFlatSteps> kLuma;
  constexpr std::integral_constant<int, kTall ? kTallChromaSteps : kFlatSteps> kChroma;
  VU16 v0, v1, v2;
  if constexpr (kSurface) {
    const CellsOfPair of(cells, pair, part.block, lane);
    v0 = sample(kLuma, luma_between(cells, of, pair, 0, part.block, lane), y0, luma_at(0, 1), stride);
    v1 = sample(kLuma, luma_between(cells, of, pair, 1, part.block, lane), y1, luma_at(1, 1), stride);
    v2 = sample(kChroma, chroma_between(cells, of, pair, part.block, lane), cb, cr, chroma_stride);
  } else {
    const WindowPositions* const window = band.luma.window.data() + entry;
    v0 = sample(kLuma, plane_between(window[0], kLumaTable, lane), y0, luma_at(0, 1), stride);
    v1 = sample(kLuma, plane_between(window[band.pitch], kLumaTable, lane), y1, luma_at(1, 1), stride);
    const WindowPositions& of_chroma = band.chroma.window[chroma_entry];
    v2 = sample(kChroma, plane_between(of_chroma, kChromaTable, lane), cb, cr + of_chroma.half, chroma_stride);
  }
  const DU16 du;
  // Takes half of the 256-fold samples, makes up for what was cut off, and weighs.
  const auto weigh = [&](VU16 samples, const int16_t* by) HWY_ATTR {
    const auto halved = hn::AverageRound(samples, hn::Set(du, kCutOff));
    return hn::MulFixedPoint15(hn::BitCast(d, halved), hn::Load(d, by + lane));
  };
  const auto without_offset = hn::BitCast(d, hn::Sub(v2, hn::Set(du, (128 << 8) - kCutOff)));
  return {weigh(v0, weights.w[upper]), weigh(v1, weights.w[lower]),
          hn::MulFixedPoint15(without_offset, chroma_weights<14>(weights.w[upper], weights.w[lower]))};
}

// The weighted samples of any kind of part; kFlat: none has windows that are tall.
template <bool kSurface, bool kFlat>
HWY_INLINE WeightedPair weigh_pair(const Part& part, int pair, size_t lane) {
  if constexpr (kSurface && !kFlat)
    if (part.verdict == SlotBand::kTall) return weigh_windows<true, true>(part, pair, lane);
  return weigh_windows<kSurface, false>(part, pair, lane);
}

// The hottest loop: the sum of `count` parts into scratch.
template <bool kSurface, bool kFlat>
inline void sum_i420(const Part* parts, int count, const PairPlace& at, Scratch& scratch) {
  const D16 d;
  const int upper = 2 * at.pair, lower = upper + 1;
  alignas(64) int16_t chroma[kBlock];
  for (size_t lane = 0; lane < kBlock; lane += hn::Lanes(d)) {
    auto sum_upper = hn::Zero(d), sum_lower = hn::Zero(d), sum_chroma = hn::Zero(d);
    for (int i = 0; i < count; i++) {
      const WeightedPair part = weigh_pair<kSurface, kFlat>(parts[i], at.pair, lane);
      sum_upper = hn::Add(sum_upper, part.upper);
      sum_lower = hn::Add(sum_lower, part.lower);
      sum_chroma = hn::Add(sum_chroma, part.chroma);
    }
    hn::StoreU(sum_upper, d, scratch.sum[upper][0] + at.out * kBlock + lane);
    hn::StoreU(sum_lower, d, scratch.sum[lower][0] + at.out * kBlock + lane);
    hn::Store(sum_chroma, d, chroma + lane);
  }
  std::copy_n(chroma, kChromaBlock, scratch.sum[at.pair][1] + at.out * kChromaBlock);
  std::copy_n(chroma + kChromaBlock, kChromaBlock, scratch.sum[at.pair][2] + at.out * kChromaBlock);
}

#endif

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
