// SPDX-License-Identifier: LGPL-2.1-or-later
// Per target, see render_band.cc: adds cameras to a block one by one, whose samples have to be gathered.
#if defined(LF_RENDER_SIMD_PARTS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_RENDER_SIMD_PARTS_INL_H_
#undef LF_RENDER_SIMD_PARTS_INL_H_
#else
#define LF_RENDER_SIMD_PARTS_INL_H_
#endif

#include <algorithm>

#include <hwy/highway.h>

#include "render/simd/band_data.h"
#include "render/simd/sums-inl.h"
#if HWY_TARGET != HWY_SCALAR
#include "render/simd/cell_samples-inl.h"
#include "render/simd/gather-inl.h"
#endif

HWY_BEFORE_NAMESPACE();
namespace lf::simd::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_SCALAR

// A machine without vectors goes the slow way everywhere.
inline bool add_part(const SumTask&, const Part&, const PairPlace&, Scratch&) { return false; }

#else

// What add_part() works with: two rows and their chroma.
struct PairSamples {
  bool any_lost = false;  // some weight is lost; else `lost` is not set
  Positions at[3];
  alignas(64) int16_t weight[2][kBlock];
  alignas(64) int16_t lost[2][kBlock];
};

// Interpolates the positions of a pair of rows.
inline void interpolate_pair(const Part& part, int pair, bool i420, bool surface, Positions out[3]) {
  const SlotBand& band = *part.band;
  if (surface) {
    interpolate_cells(band.surface, pair, part.block, i420, out);
    // The corner was told for Cb.
    const ptrdiff_t cb = band.slot->image.stride[1], cr = band.slot->image.stride[2];
    if (i420 && cb != cr) out[2].corner[1] = static_cast<int32_t>(out[2].corner[0] / cb * cr + out[2].corner[0] % cb);
    return;
  }
  for (int r = 0; r < 2; r++)
    interpolate_positions(band.luma, (2 * pair + r) * band.pitch + part.block, kLumaTable, out[r]);
  if (i420) interpolate_positions(band.chroma, pair * band.pitch + part.block, kChromaTable, out[2]);
}

// Inverse distances of the samples of a row of a block, which is at y of the band; those of chroma twice over.
inline void find_inverse(const FocalMap& map, const CellNodes& nodes, const PairPlace& place, float y, bool chroma,
                         float* out) {
  if (map.step == kCell) return inverse_along(nodes, CellRow(y), place.x / kHalf, chroma, out);
  map.inverse_row(place.x + (chroma ? 0.5 : 0), chroma ? 2 : 1, place.y + y, chroma ? kHalf : kBlock, out);
  if (chroma) std::copy_n(out, kHalf, out + kHalf);
}

// Finds positions and weights of a pair of rows; false where rounding could decide on a sample.
inline bool find_samples(const SumTask& task, const Part& part, bool project, const PairPlace& place,
                         const CellNodes& inverse_nodes, PairSamples& out) {
  const int upper = 2 * place.pair;
  for (int r = 0; r < 2; r++) std::copy_n(part.weights->w[upper + r], kBlock, out.weight[r]);
  const Slot& slot = *part.band->slot;
  const bool i420 = task.family == PixelFamily::kI420;
  const FocalMap* const map = task.plan->view().focus.map.get();
  if (!project) {
    interpolate_pair(part, place.pair, i420, map != nullptr, out.at);
    return true;
  }
  std::fill_n(out.lost[0], 2 * kBlock, 0);
  for (int i = 0; i < (i420 ? 3 : 2); i++) {
    const bool chroma = i == 2;
    const float y = static_cast<float>(upper) + (chroma ? 0.5f : static_cast<float>(i));
    int16_t *const weight = chroma ? nullptr : out.weight[i], *const lost = chroma ? nullptr : out.lost[i];
    const UnitTable& table = chroma ? kChromaTable : kLumaTable;
    Sight sight;
    if (map) {
      alignas(64) float inverse[kBlock];
      find_inverse(*map, inverse_nodes, place, y, chroma, inverse);
      const float from_top = static_cast<float>(place.y - slot.rect.y0 / kBandRows * kBandRows) + y;
      sight = project_positions(task, slot, slot.terms, chroma, static_cast<float>(kBlock * part.block), from_top,
                                table, inverse, weight, lost, out.at[i]);
    } else {
      sight = project_positions(task, slot, terms_at(slot, place.x, place.y + y), chroma, 0, 0, table, nullptr, weight,
                                lost, out.at[i]);
    }
    if (sight == Sight::kDoubtful) return false;
    out.any_lost = out.any_lost || sight == Sight::kSome;
  }
  return true;
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
  alignas(64) int16_t values[3][kBlock];
  for (int r = 0; r < 2; r++) {
    gather_pixels(samples.at[r], slot, values);
    for (int c = 0; c < 3; c++)
      add_samples(values[c], samples.weight[r], scratch.sum[2 * place.pair + r][c] + place.out * kBlock);
  }
}

// Adds a part that can't be shuffled. False if some of its samples are in doubt: nothing was added.
inline bool add_part(const SumTask& task, const Part& part, const PairPlace& place, Scratch& scratch) {
  const bool project = task.exact || part.verdict == SlotBand::kProject;
  PairSamples samples;
  if (!find_samples(task, part, project, place, scratch.inverse, samples)) return false;
  scratch.any_lost = scratch.any_lost || samples.any_lost;
  for (int r = 0; r < 2 && samples.any_lost; r++) {
    uint16_t* const lost = scratch.lost[2 * place.pair + r] + place.out * kBlock;
    for (int i = 0; i < kBlock; i++) lost[i] = static_cast<uint16_t>(lost[i] + samples.lost[r][i]);
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
