// SPDX-License-Identifier: LGPL-2.1-or-later
// Per target, see render_band.cc: the sum over the cameras of one block.
#if defined(LF_RENDER_SIMD_SUMS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_RENDER_SIMD_SUMS_INL_H_
#undef LF_RENDER_SIMD_SUMS_INL_H_
#else
#define LF_RENDER_SIMD_SUMS_INL_H_
#endif

#include <algorithm>
#include <cstring>

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include "render/simd/band_data.h"
#if HWY_TARGET != HWY_SCALAR
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
  int32_t verdict;  // SlotBand::Verdict, of a pair of rows
};

// A pair of rows of a block.
struct PairPlace {
  int pair;  // in the band
  int x, y;  // the block's and the band's first pixel
  int out;   // the block's number in scratch
};

#if HWY_TARGET == HWY_SCALAR

inline void sum_i420(const Part*, int, const PairPlace& at, Scratch& scratch) {
  for (int r = 2 * at.pair; r < 2 * at.pair + 2; r++) std::fill_n(scratch.sum[r][0] + at.out * kBlock, kBlock, 0);
  for (int c = 1; c < 3; c++) std::fill_n(scratch.sum[at.pair][c] + at.out * kChromaBlock, kChromaBlock, 0);
}
inline void store_i420(const Part&, const PairPlace&, const SlotTarget&) {}
// A machine without vectors goes the slow way everywhere.
inline bool add_part(const SumTask&, const Part&, const PairPlace&, Scratch&) { return false; }

#else

// The weight of chroma: the mean of its four pixels', 2^kBits = 1, for both planes. `upper`, `lower`: two rows of
// weights.
template <int kBits>
HWY_INLINE V16 chroma_weights(const int16_t* upper, const int16_t* lower) {
  constexpr int kShift = 17 - kBits;  // of the sum of four
  const D16 d;
  const DU16 du;
  const hn::Repartition<uint32_t, D16> d32;
  const auto half = [&](size_t i) HWY_ATTR {  // of as many samples as a vector has 32-bit lanes
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

// Rows to come: cameras' rows are too far apart for the machine to see a pattern.
inline constexpr int kPrefetchRows = 8;

// The weighted samples of a part's pair of rows, lane..: two rows of luma, and chroma.
struct WeightedPair {
  V16 upper, lower, chroma;
};
HWY_INLINE WeightedPair weigh_pair(const Part& part, int pair, size_t lane) {
  const D16 d;
  const SlotBand& band = *part.band;
  const ImageView& image = band.slot->image;
  const int upper = 2 * pair, lower = upper + 1;
  const BlockWeights& weights = *part.weights;
  const ptrdiff_t stride = image.stride[0], chroma_stride = image.stride[1];
  const ptrdiff_t entry = upper * band.pitch + part.block, chroma_entry = pair * band.pitch + part.block;
  const uint8_t* const y0 = image.plane[0] + band.luma.corner[entry];
  const uint8_t* const y1 = image.plane[0] + band.luma.corner[entry + band.pitch];
  const uint8_t* const cb = image.plane[1] + band.chroma.corner[chroma_entry];
  const uint8_t* const cr = image.plane[2] + band.chroma.corner[chroma_entry];
  hwy::Prefetch(y0 + kPrefetchRows * stride);
  hwy::Prefetch(y1 + kPrefetchRows * stride);
  hwy::Prefetch(cb + kPrefetchRows / 2 * chroma_stride);
  hwy::Prefetch(cr + kPrefetchRows / 2 * chroma_stride);
  const auto sample_at = [lane](const WindowPositions& at, const UnitTable& table, const uint8_t* low,
                                const uint8_t* high, ptrdiff_t bytes)
                             HWY_ATTR { return sample_windows(at, table, low, high + at.half, bytes, lane); };
  const DU16 du;
  // Half of 256 times the samples, with what sample_windows() cuts off.
  const auto weigh = [&](VU16 samples, const int16_t* by) HWY_ATTR {
    const auto halved = hn::AverageRound(samples, hn::Set(du, kCutOff));
    return hn::MulFixedPoint15(hn::BitCast(d, halved), hn::Load(d, by + lane));
  };
  const auto v0 = sample_at(band.luma.window[entry], kLumaTable, y0, y0, stride);
  const auto v1 = sample_at(band.luma.window[entry + band.pitch], kLumaTable, y1, y1, stride);
  const auto v2 = sample_at(band.chroma.window[chroma_entry], kChromaTable, cb, cr, chroma_stride);
  const auto without_offset = hn::BitCast(d, hn::Sub(v2, hn::Set(du, (128 << 8) - kCutOff)));
  return {weigh(v0, weights.w[upper]), weigh(v1, weights.w[lower]),
          hn::MulFixedPoint15(without_offset, chroma_weights<14>(weights.w[upper], weights.w[lower]))};
}

// The hottest loop: the sum of `count` parts into scratch.
inline void sum_i420(const Part* parts, int count, const PairPlace& at, Scratch& scratch) {
  const D16 d;
  const int upper = 2 * at.pair, lower = upper + 1;
  alignas(64) int16_t chroma[kBlock];
  for (size_t lane = 0; lane < kBlock; lane += hn::Lanes(d)) {
    auto sum_upper = hn::Zero(d), sum_lower = hn::Zero(d), sum_chroma = hn::Zero(d);
    for (int i = 0; i < count; i++) {
      const WeightedPair part = weigh_pair(parts[i], at.pair, lane);
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

// A part by itself, rounded, to its slot's fragment.
inline void store_i420(const Part& part, const PairPlace& at, const SlotTarget& to) {
  const D16 d;
  const hn::Rebind<uint8_t, D16> d8;
  const hn::Rebind<int8_t, D16> di8;
  const auto rounded = [&](V16 v) HWY_ATTR {
    return hn::ShiftRight<kSumFractionBits>(hn::Add(v, hn::Set(d, 1 << (kSumFractionBits - 1))));
  };
  const int row = at.y + 2 * at.pair - to.y0;
  const ptrdiff_t block = at.x / kBlock - to.first_block;
  uint8_t* const upper = to.plane[0] + row * to.stride[0] + block * kBlock;
  alignas(64) int8_t chroma[kBlock];
  for (size_t lane = 0; lane < kBlock; lane += hn::Lanes(d)) {
    const WeightedPair v = weigh_pair(part, at.pair, lane);
    hn::StoreU(hn::DemoteTo(d8, rounded(v.upper)), d8, upper + lane);
    hn::StoreU(hn::DemoteTo(d8, rounded(v.lower)), d8, upper + to.stride[0] + lane);
    hn::Store(hn::DemoteTo(di8, rounded(v.chroma)), di8, chroma + lane);
  }
  for (int c = 0; c < 2; c++)
    std::memcpy(to.plane[1 + c] + row / 2 * to.stride[1 + c] + block * kChromaBlock, chroma + c * kChromaBlock,
                kChromaBlock);
}

// What add_part() works with: two rows and their chroma.
struct PairSamples {
  Positions at[3];
  alignas(64) int16_t weight[2][kBlock];
  alignas(64) int16_t lost[2][kBlock];
};

// Positions and weights of a pair of rows. False: in doubt.
inline bool find_samples(const SumTask& task, const Part& part, bool project, const PairPlace& place,
                         const BandMap& map, PairSamples& out) {
  const int upper = 2 * place.pair;
  for (int r = 0; r < 2; r++) std::copy_n(part.weights->w[upper + r], kBlock, out.weight[r]);
  const SlotBand& band = *part.band;
  const bool i420 = task.family == PixelFamily::kI420;
  if (!project) {
    for (int r = 0; r < 2; r++)
      interpolate_positions(band.luma, (upper + r) * band.pitch + part.block, kLumaTable, out.at[r]);
    if (i420) interpolate_positions(band.chroma, place.pair * band.pitch + part.block, kChromaTable, out.at[2]);
    std::fill_n(out.lost[0], 2 * kBlock, 0);
    return true;
  }
  std::fill_n(out.lost[0], 2 * kBlock, 0);
  const bool has_map = task.plan->view().focus.map != nullptr;
  for (int r = 0; r < 2; r++)
    if (project_positions(task, *part.band->slot, false, place.x, place.y + upper + r, kLumaTable,
                          has_map ? map.luma[upper + r].data() + place.out * kBlock : nullptr, out.weight[r],
                          out.lost[r], out.at[r]) == Sight::kDoubtful)
      return false;
  if (!i420) return true;
  alignas(64) float chroma_inverse[kBlock];
  if (has_map)
    for (int half = 0; half < 2; half++)
      std::copy_n(map.chroma[place.pair].data() + place.out * kChromaBlock, kChromaBlock,
                  chroma_inverse + half * kChromaBlock);
  return project_positions(task, *part.band->slot, true, place.x, place.y + upper, kChromaTable,
                           has_map ? chroma_inverse : nullptr, nullptr, nullptr, out.at[2]) != Sight::kDoubtful;
}

inline void add_samples(const int16_t* samples, const int16_t* weights, int16_t* sum) {
  const D16 d;
  for (size_t i = 0; i < kBlock; i += hn::Lanes(d)) {
    const auto weighted = hn::MulFixedPoint15(hn::Load(d, samples + i), hn::Load(d, weights + i));
    hn::StoreU(hn::Add(hn::LoadU(d, sum + i), weighted), d, sum + i);
  }
}

inline void add_i420(const Slot& slot, const PairSamples& samples, const PairPlace& place, Scratch& scratch) {
  const D16 d;
  const ImageView& image = slot.image;
  alignas(64) int16_t values[kBlock];
  for (int r = 0; r < 2; r++) {
    gather_bytes(samples.at[r], image.plane[0], image.plane[0], image.stride[0], image.stride[0], values);
    add_samples(values, samples.weight[r], scratch.sum[2 * place.pair + r][0] + place.out * kBlock);
  }
  gather_bytes(samples.at[2], image.plane[1], image.plane[2], image.stride[1], image.stride[2], values);
  for (size_t i = 0; i < kBlock; i += hn::Lanes(d))
    hn::Store(weigh_chroma(hn::Load(d, values + i), chroma_weights<15>(samples.weight[0], samples.weight[1])), d,
              values + i);
  for (int c = 0; c < 2; c++) {
    int16_t* const sum = scratch.sum[place.pair][1 + c] + place.out * kChromaBlock;
    for (int i = 0; i < kChromaBlock; i++) sum[i] = static_cast<int16_t>(sum[i] + values[c * kChromaBlock + i]);
  }
}

inline void add_rgb(const Slot& slot, const PairSamples& samples, const PairPlace& place, Scratch& scratch) {
  const RgbLayout& layout = slot.image.layout;
  const int offset[3] = {layout.r, layout.g, layout.b};
  for (int r = 0; r < 2; r++) {
    PixelPairs pixels;
    gather_pixels(samples.at[r], slot.image.plane[0], slot.image.stride[0], layout.pixel_stride, pixels);
    for (int c = 0; c < 3; c++) {
      const int16_t* from = (offset[c] & 1 ? pixels.odd : pixels.even) + (offset[c] >> 1);
      alignas(64) int16_t values[kBlock];
      for (int i = 0; i < kBlock; i++) values[i] = from[2 * i];
      add_samples(values, samples.weight[r], scratch.sum[2 * place.pair + r][c] + place.out * kBlock);
    }
  }
}

// Adds a part that can't be shuffled. False if some of its samples are in doubt: nothing was added.
inline bool add_part(const SumTask& task, const Part& part, const PairPlace& place, Scratch& scratch) {
  const bool project = task.exact || part.verdict == SlotBand::kProject;
  PairSamples samples;
  if (!find_samples(task, part, project, place, scratch.map, samples)) return false;
  for (int r = 0; r < 2; r++) {
    uint16_t* const lost = scratch.lost[2 * place.pair + r] + place.out * kBlock;
    for (int i = 0; project && i < kBlock; i++) {
      lost[i] = static_cast<uint16_t>(lost[i] + samples.lost[r][i]);
      scratch.any_lost = scratch.any_lost || samples.lost[r][i] != 0;
    }
  }
  if (task.family == PixelFamily::kI420)
    add_i420(*part.band->slot, samples, place, scratch);
  else
    add_rgb(*part.band->slot, samples, place, scratch);
  return true;
}

#endif

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
