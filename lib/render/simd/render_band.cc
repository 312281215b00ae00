// SPDX-License-Identifier: LGPL-2.1-or-later
// Compiled once per instruction set. The best available set is used at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/simd/render_band.cc"
#include <hwy/foreach_target.h>
// must follow foreach_target.h
#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include <algorithm>
#include <type_traits>

#include "render/simd/cells-inl.h"
#include "render/simd/placement-inl.h"
#include "render/simd/samples-inl.h"
#include "render/simd/sum_task.h"
#include "render/simd/weights-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lf::simd::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// One camera's contribution to a block of a band: its weights, and the positions of its samples.
struct Part {
  const BlockWeights* weights;
  const SlotBand* band;
  int32_t block;
  int32_t method;  // SlotBand::SampleMethod of the pair of rows
};

struct PairPlace {
  int pair;  // index of the pair in the band
  int x, y;  // first pixel of the block and of the band
  int out;   // index of the block in scratch
};

#if HWY_TARGET == HWY_SCALAR

template <bool kSurface, bool kFlat>
inline void sum_i420(const Part*, int, const PairPlace& at, Scratch& scratch) {
  for (int r = 2 * at.pair; r < 2 * at.pair + 2; r++) std::fill_n(scratch.sum[r][0] + at.out * kBlock, kBlock, 0);
  for (int c = 1; c < 3; c++) std::fill_n(scratch.sum[at.pair][c] + at.out * kChromaBlock, kChromaBlock, 0);
}

// Without vector instructions, every sample takes the slow path.
inline bool add_part(const SumTask&, const Part&, const PairPlace&, Scratch&) { return false; }

#else

// Returns the weights of the chroma samples, for Cb and then for Cr: the mean weight of the four pixels. 2^kBits is
// weight 1. `upper` and `lower` are the weights of two rows of pixels.
template <int kBits>
HWY_INLINE V16 chroma_weights(const int16_t* upper, const int16_t* lower) {
  constexpr int kShift = 17 - kBits;  // converts the sum of four to their mean
  const D16 d;
  const DU16 du;
  const hn::Repartition<uint32_t, D16> d32;
  const auto half = [&](size_t i) HWY_ATTR {  // computes one mean per 32-bit lane of a vector
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

HWY_INLINE V16 weigh_chroma(V16 samples, V16 weights) {
  return hn::MulFixedPoint15(hn::Sub(samples, hn::Set(D16(), 128 << kSumFractionBits)), weights);
}

// Number of image rows ahead that are prefetched, because image rows are too far apart for the hardware prefetcher.
inline constexpr int kPrefetchRows = 8;

// The samples of a part multiplied by its weights, for a pair of rows: two rows of luma, and chroma.
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
  // Locates the windows of luma's halves, row by row, and of chroma.
  const SurfaceBand& cells = band.surface;
  const ptrdiff_t entry = upper * band.pitch + part.block, chroma_entry = pair * band.pitch + part.block;
  const ptrdiff_t cell = upper * ptrdiff_t{cells.pitch} + 2 * part.block,
                  chroma_cell = pair * ptrdiff_t{cells.pitch} / 2 + part.block;
  const auto luma_at = [&](int row, int half) HWY_ATTR {
    if constexpr (kSurface) return image.plane[0] + cells.luma_corner[cell + row * ptrdiff_t{cells.pitch} + half];
    const ptrdiff_t at = entry + row * band.pitch;
    const uint8_t* const corner = image.plane[0] + band.luma.corner[at];
    if (half == 0) return corner;
    const WindowPositions& window = band.luma.window[at];
    return kTall ? corner + window.columns_to_half() + window.rows_to_half() * stride : corner + window.half;
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
  constexpr std::integral_constant<int, !kTall ? kFlatSteps : kSurface ? kTallSteps : kSlopedSteps> kLuma;
  constexpr std::integral_constant<int, !kTall ? kFlatSteps : kSurface ? kTallChromaSteps : kSlopedSteps> kChroma;
  VU16 v0, v1, v2;
  if constexpr (kSurface) {
    const CellsOfPair of(cells, pair, part.block, lane);
    v0 = sample(kLuma, luma_between(cells, of, pair, 0, part.block, lane), y0, luma_at(0, 1), stride);
    v1 = sample(kLuma, luma_between(cells, of, pair, 1, part.block, lane), y1, luma_at(1, 1), stride);
    v2 = sample(kChroma, chroma_between(cells, of, pair, part.block, lane), cb, cr, chroma_stride);
  } else {
    const WindowPositions* const window = band.luma.window.data() + entry;
    v0 = sample(kLuma, plane_between<kTall>(window[0], kLumaTable, lane), y0, luma_at(0, 1), stride);
    v1 = sample(kLuma, plane_between<kTall>(window[band.pitch], kLumaTable, lane), y1, luma_at(1, 1), stride);
    const WindowPositions& of_chroma = band.chroma.window[chroma_entry];
    v2 = sample(kChroma, plane_between<kTall>(of_chroma, kChromaTable, lane), cb, cr + of_chroma.half, chroma_stride);
  }
  const DU16 du;
  // Halves the 256-fold samples, compensates the truncation, and multiplies by the weights.
  const auto weigh = [&](VU16 samples, const int16_t* by) HWY_ATTR {
    const auto halved = hn::AverageRound(samples, hn::Set(du, kCutOff));
    return hn::MulFixedPoint15(hn::BitCast(d, halved), hn::Load(d, by + lane));
  };
  const auto without_offset = hn::BitCast(d, hn::Sub(v2, hn::Set(du, (128 << 8) - kCutOff)));
  return {weigh(v0, weights.w[upper]), weigh(v1, weights.w[lower]),
          hn::MulFixedPoint15(without_offset, chroma_weights<14>(weights.w[upper], weights.w[lower]))};
}

// Computes the weighted samples of a part, for the lanes that begin at `lane`. kSurface: the view has a focal map.
// kFlat: no part has tall windows.
template <bool kSurface, bool kFlat>
HWY_INLINE WeightedPair weigh_pair(const Part& part, int pair, size_t lane) {
  if constexpr (!kFlat)
    if (part.method == SlotBand::kTall) return weigh_windows<kSurface, true>(part, pair, lane);
  return weigh_windows<kSurface, false>(part, pair, lane);
}

// Adds up the weighted samples of `count` parts into scratch. This is the hottest loop of the renderer.
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

// The samples of a part that cannot be shuffled, for a pair of rows: two rows of luma or RGB, and chroma.
struct PairSamples {
  bool any_missing = false;  // some weight is missing; otherwise `lost` is unset
  Positions at[3];
  alignas(64) int16_t weight[2][kBlock];
  alignas(64) int16_t lost[2][kBlock];
};

inline void interpolate_pair(const Part& part, int pair, bool i420, bool surface, Positions out[3]) {
  const SlotBand& band = *part.band;
  if (surface) {
    interpolate_cells(band.surface, pair, part.block, i420, out);
    // The corner is an offset in the Cb plane; converts it for Cr.
    const ptrdiff_t cb = band.slot->image.stride[1], cr = band.slot->image.stride[2];
    if (i420 && cb != cr) out[2].corner[1] = static_cast<int32_t>(out[2].corner[0] / cb * cr + out[2].corner[0] % cb);
    return;
  }
  for (int r = 0; r < 2; r++)
    interpolate_positions(band.luma, (2 * pair + r) * band.pitch + part.block, kLumaTable, out[r]);
  if (i420) interpolate_positions(band.chroma, pair * band.pitch + part.block, kChromaTable, out[2]);
}

// Replaces the inverse distances of pixels in cells with depth edges. A chroma sample takes the upper left of its
// pixels.
inline void replace_at_edges(const DepthEdges& edges, const PairPlace& place, int y, bool chroma, float* out) {
  const int step = chroma ? 2 : 1, count = chroma ? kHalf : kBlock;
  if (DepthEdges::cell_of(y) >= edges.rows) return;
  for (int i = 0; i < count; i++) {
    const int x = place.x + step * i;
    if (DepthEdges::cell_of(x) >= edges.columns) return;
    if (const float* const depth = edges.depth_at(x, y)) out[i] = *depth;
  }
}

// Computes the inverse distances of the focal surface at the samples of a block, `y` rows below the top of the band.
// For chroma, the result has the same kHalf values twice. `edges` may be null.
inline void find_inverse(const FocalMap& map, const DepthEdges* edges, const CellNodes& nodes, const PairPlace& place,
                         float y, bool chroma, float* out) {
  if (map.step == kCell) {
    inverse_along(nodes, CellRow(y), place.x / kHalf, chroma, out);
    if (!edges) return;
    replace_at_edges(*edges, place, place.y + static_cast<int>(y), chroma, out);
    if (chroma) std::copy_n(out, kHalf, out + kHalf);
    return;
  }
  map.inverse_row(place.x + (chroma ? 0.5 : 0), chroma ? 2 : 1, place.y + y, chroma ? kHalf : kBlock, out);
  if (chroma) std::copy_n(out, kHalf, out + kHalf);
}

// Computes the positions and weights of the samples in a pair of rows. Returns false if rounding of float could decide
// whether a sample is visible.
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
    Visibility visibility;
    if (map) {
      alignas(64) float inverse[kBlock];
      find_inverse(*map, slot.edges, inverse_nodes, place, y, chroma, inverse);
      const float from_top = static_cast<float>(place.y - slot.rect.y0 / kBandRows * kBandRows) + y;
      visibility = project_positions(task, slot, slot.terms, chroma, static_cast<float>(kBlock * part.block), from_top,
                                     table, inverse, weight, lost, out.at[i]);
    } else {
      visibility = project_positions(task, slot, terms_at(slot, place.x, place.y + y), chroma, 0, 0, table, nullptr,
                                     weight, lost, out.at[i]);
    }
    if (visibility == Visibility::kUnknown) return false;
    out.any_missing = out.any_missing || visibility == Visibility::kSome;
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

// Adds a part with samples that cannot be shuffled. Returns false, without adding anything, if float cannot decide
// whether a sample is visible. The caller then uses add_mixed_block().
inline bool add_part(const SumTask& task, const Part& part, const PairPlace& place, Scratch& scratch) {
  const bool project = task.exact || part.method == SlotBand::kProject;
  PairSamples samples;
  if (!find_samples(task, part, project, place, scratch.inverse, samples)) return false;
  scratch.any_missing = scratch.any_missing || samples.any_missing;
  for (int r = 0; r < 2 && samples.any_missing; r++) {
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

inline void add_missing_weight(const BlockWeights& weights, const PairPlace& at, Scratch& scratch) {
  const hn::CappedTag<uint16_t, kBlock> d;
  scratch.any_missing = true;
  for (int r = 2 * at.pair; r < 2 * at.pair + 2; r++)
    for (size_t i = 0; i < kBlock; i += hn::Lanes(d)) {
      uint16_t* to = scratch.lost[r] + at.out * kBlock + i;
      const auto w = hn::BitCast(d, hn::Load(hn::RebindToSigned<decltype(d)>(), weights.w[r] + i));
      hn::StoreU(hn::SaturatedAdd(hn::LoadU(d, to), w), d, to);
    }
}

inline void clear_pair(bool i420, const PairPlace& at, Scratch& scratch) {
  for (int r = 2 * at.pair; r < 2 * at.pair + 2; r++)
    for (int c = 0; c < (i420 ? 1 : 3); c++) std::fill_n(scratch.sum[r][c] + at.out * kBlock, kBlock, 0);
  for (int c = 1; c < 3 && i420; c++) std::fill_n(scratch.sum[at.pair][c] + at.out * kChromaBlock, kChromaBlock, 0);
}

inline constexpr int kMaxParts = kBandRows * 3 * kBlock;  // three corners of a face for every pixel
static_assert(kMaxParts >= 4 * WeightGrid::kMaxShares);   // cameras of the four points of a cell

// All parts of a block, one for each local camera that contributes to the block.
struct BlockParts {
  Part part[kMaxParts];
  int count = 0;
  uint32_t interior = ~0u;  // bit p is set if pair p of all parts can be shuffled
  bool flat = true;         // no part is in sloped rows
  uint32_t rows = ~0u;      // bit r is set if all parts have weights in row r
};

inline void find_parts(const SumTask& task, int block, int out, bool shuffles, const Scratch& scratch,
                       BlockParts& parts) {
  if (!shuffles) parts.interior = 0;
  for (int32_t i = scratch.head[out]; i >= 0; i = scratch.weights[i].next) {
    const BlockWeights& weights = scratch.weights[i];
    const SlotBand& band = scratch.bands[weights.slot];
    const Slot& slot = task.slots[weights.slot];
    const bool seen = slot.image.family != PixelFamily::kNone;
    const bool sloped = band.interior == SlotBand::kTall;
    parts.part[parts.count++] = {&weights, &band, block - band.first_block,
                                 !seen    ? SlotBand::kAllMissing
                                 : sloped ? SlotBand::kTall
                                          : SlotBand::kShuffle};
    parts.flat = parts.flat && !(seen && sloped);
    parts.interior &= shuffles && seen && !slot.needs_double ? band.interior_pairs(block - band.first_block) : 0;
    parts.rows &= weights.rows;
  }
}

// Renders the sum in a block. `block` is the index of the block in the view, `out` its index in the rectangle, and `y`
// the first row of the band.
inline void render_block(const SumTask& task, const Rect& rect, int block, int out, int y, Scratch& scratch) {
  const View& view = task.plan->view();
  const int x = block * kBlock;
  const bool i420 = task.family == PixelFamily::kI420, separable = task.plan->rays().separable();
  const bool surface = view.focus.map != nullptr;
  const auto sum_flat = surface ? sum_i420<true, true> : sum_i420<false, true>,
             sum_any = surface ? sum_i420<true, false> : sum_i420<false, false>;
  const bool odd_column = i420 && view.width % 2 != 0 && x + kBlock > view.width - 1;
  const bool shuffles = i420 && separable && !odd_column && !task.exact && HWY_TARGET != HWY_SCALAR;
  BlockParts all;
  find_parts(task, block, out, shuffles, scratch, all);
  Part shuffled[kMaxParts], slow[kMaxParts];
  for (int pair = 0; pair < kBandPairs && y + 2 * pair < rect.y1; pair++) {
    if (y + 2 * pair + 1 < rect.y0) continue;
    const PairPlace place{pair, x, y, out};
    // A chroma sample at the border of an odd view has only one or two pixels.
    const bool odd = odd_column || (i420 && y + 2 * pair + 1 >= view.height), alone = odd || !separable;
    // The common case: all parts can be shuffled.
    if (HWY_LIKELY(!odd && (all.interior >> pair & 1) && (all.rows >> (2 * pair) & 3))) {
      (all.flat ? sum_flat : sum_any)(all.part, all.count, place, scratch);
      continue;
    }
    int num_shuffled = 0, num_slow = 0;
    bool flat = true;
    for (int i = 0; i < all.count; i++) {
      Part part = all.part[i];
      if (!(part.weights->rows >> (2 * pair) & 3)) continue;
      if (part.method != SlotBand::kAllMissing) {
        if (alone || part.band->slot->needs_double)
          part.method = SlotBand::kProject;
        else if (part.band->interior == SlotBand::kProject)
          part.method = part.band->method[pair * part.band->method_pitch + part.block];
      }
      if (part.method == SlotBand::kAllMissing)
        add_missing_weight(*part.weights, place, scratch);
      else if (shuffles && part.method >= SlotBand::kTall)
        shuffled[num_shuffled++] = part, flat = flat && part.method == SlotBand::kShuffle;
      else
        slow[num_slow++] = part;
    }
    if (i420)
      (flat ? sum_flat : sum_any)(shuffled, num_shuffled, place, scratch);
    else
      clear_pair(i420, place, scratch);
    for (int i = 0; i < num_slow; i++)
      if (alone || slow[i].band->slot->needs_double || !add_part(task, slow[i], place, scratch))
        add_mixed_block(task, *slow[i].weights, pair, x, out, rect.y1, y, scratch);
  }
}

// Computes where the samples of a camera are in the band that begins at row y, and how they are read.
inline void place_slot(const SumTask& task, const Slot& slot, int y, const CellNodes& inverse, CellWork& work,
                       SlotBand& band) {
  const bool i420 = task.family == PixelFamily::kI420, follows = band.y >= 0 && band.y == y - kBandRows;
  band.y = y;
  band.slot = &slot;
  band.first_block = slot.rect.x0 / kBlock;
  band.blocks = (slot.rect.x1 + kBlock - 1) / kBlock - band.first_block;
  const FocalMap* const map = task.plan->view().focus.map.get();
  if (map)
    place_surface(i420, slot, y, follows, map->step == kCell ? &inverse : nullptr, work, band);
  else
    place_plane(i420, slot, y, band);
}

void RenderBand(const SumTask& task, const Rect& rect, int y, Scratch& scratch) {
  weigh_band(task, rect, y, scratch);
  const int first_block = rect.x0 / kBlock, blocks = (rect.x1 + kBlock - 1) / kBlock - first_block;
  const FocalMap* const map = task.plan->view().focus.map.get();
  if (map && map->step == kCell) place_nodes(*map, y, task.plan->view().width, scratch.inverse);
  if (task.plan->rays().separable())
    for (size_t i = 0; i < scratch.weights_used; i++) {
      const int32_t number = scratch.weights[i].slot;
      const Slot& slot = task.slots[number];
      if (scratch.bands[number].y == y || slot.image.family == PixelFamily::kNone) continue;
      place_slot(task, slot, y, scratch.inverse, scratch.cells, scratch.bands[number]);
    }
  for (uint16_t* lost : scratch.lost) std::fill_n(lost, blocks * kBlock, 0);
  if (task.has_visibility) apply_visibility(task, rect, y, scratch);
  for (int i = 0; i < blocks; i++) render_block(task, rect, first_block + i, i, y, scratch);
}

void FindInteriorRows(PixelFamily family, Slot& slot) { set_interior_rows(family, slot); }

const char* TargetName() { return hwy::TargetName(HWY_TARGET); }

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lf::simd {
HWY_EXPORT(RenderBand);
HWY_EXPORT(FindInteriorRows);
HWY_EXPORT(TargetName);

void render_band(const SumTask& task, const Rect& rect, int y, Scratch& scratch) {
  try {
    HWY_DYNAMIC_DISPATCH(RenderBand)(task, rect, y, scratch);
  } catch (...) {  // allocation failed; partially resized buffers are inconsistent
    scratch = {};
    throw;
  }
}
void find_interior_rows(PixelFamily family, Slot& slot) { HWY_DYNAMIC_DISPATCH(FindInteriorRows)(family, slot); }
const char* target_name() { return HWY_DYNAMIC_DISPATCH(TargetName)(); }

}  // namespace lf::simd
#endif
