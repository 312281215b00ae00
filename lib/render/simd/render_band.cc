// SPDX-License-Identifier: LGPL-2.1-or-later
// Compiled once for each instruction set; the best one that the machine has runs.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/simd/render_band.cc"
#include <hwy/foreach_target.h>
// After foreach_target.h:
#include <hwy/highway.h>

#include <algorithm>

#include "render/simd/band_data.h"
#include "render/simd/parts-inl.h"
#include "render/simd/plane-inl.h"
#include "render/simd/sums-inl.h"
#include "render/simd/surface-inl.h"
#include "render/simd/weights-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lf::simd::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

inline void add_lost(const BlockWeights& weights, const PairPlace& at, Scratch& scratch) {
  const hn::CappedTag<uint16_t, kBlock> d;
  scratch.any_lost = true;
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

inline constexpr int kMostParts = kBandRows * 3 * kBlock;  // three corners of a face for every pixel
static_assert(kMostParts >= 4 * BlendGrid::kMaxShares);    // those of four nodes

// The parts of a block of `width` view pixels.
struct BlockParts {
  Part part[kMostParts];
  int count = 0;
  uint32_t calm = ~0u;  // bit p: all are to be shuffled in pair p
  uint32_t rows = ~0u;  // that all of them have a weight in
};

inline void find_parts(const SumTask& task, int block, int out, bool shuffles, const Scratch& scratch,
                       BlockParts& parts) {
  if (!shuffles) parts.calm = 0;
  for (int32_t i = scratch.head[out]; i >= 0; i = scratch.weights[i].next) {
    const BlockWeights& weights = scratch.weights[i];
    const SlotBand& band = scratch.bands[weights.slot];
    const bool seen = task.slots[weights.slot].image.family != PixelFamily::kNone;
    parts.part[parts.count++] = {&weights, &band, block - band.first_block,
                                 seen ? SlotBand::kShuffle : SlotBand::kAllLost};
    parts.calm &= shuffles && seen ? band.calm_pairs(block - band.first_block) : 0;
    parts.rows &= weights.rows;
  }
}

// `block`: of the view; `out`: counted from the rectangle's first one; y: the band's first row.
inline void render_block(const SumTask& task, const Rect& rect, int block, int out, int y, Scratch& scratch) {
  const View& view = task.plan->view();
  const int x = block * kBlock;
  const bool i420 = task.family == PixelFamily::kI420, separable = task.plan->rays().separable();
  const bool surface = view.focus.map != nullptr;
  const auto sum_flat = surface ? sum_i420<true, true> : sum_i420<false, true>,
             sum_any = surface ? sum_i420<true, false> : sum_flat;
  const bool odd_column = i420 && view.width % 2 != 0 && x + kBlock > view.width - 1;
  const bool shuffles = i420 && separable && !odd_column && !task.exact && HWY_TARGET != HWY_SCALAR;
  BlockParts all;
  find_parts(task, block, out, shuffles, scratch, all);
  Part shuffled[kMostParts], slow[kMostParts];
  for (int pair = 0; pair < kBandPairs && y + 2 * pair < rect.y1; pair++) {
    if (y + 2 * pair + 1 < rect.y0) continue;
    const PairPlace place{pair, x, y, out};
    // A chroma sample at the border of an odd view has only two pixels, or one.
    const bool odd = odd_column || (i420 && y + 2 * pair + 1 >= view.height), alone = odd || !separable;
    // Nearly everywhere there is nothing to ask.
    if (HWY_LIKELY(!odd && (all.calm >> pair & 1) && (all.rows >> (2 * pair) & 3))) {
      sum_flat(all.part, all.count, place, scratch);
      continue;
    }
    int num_shuffled = 0, num_slow = 0;
    bool flat = true;
    for (int i = 0; i < all.count; i++) {
      Part part = all.part[i];
      if (!(part.weights->rows >> (2 * pair) & 3)) continue;
      if (part.verdict != SlotBand::kAllLost) {
        if (alone)
          part.verdict = SlotBand::kProject;
        else if (!part.band->calm)
          part.verdict = part.band->verdict[pair * part.band->verdict_pitch + part.block];
      }
      if (part.verdict == SlotBand::kAllLost)
        add_lost(*part.weights, place, scratch);
      else if (shuffles && part.verdict >= SlotBand::kTall)
        shuffled[num_shuffled++] = part, flat = flat && part.verdict == SlotBand::kShuffle;
      else
        slow[num_slow++] = part;
    }
    if (i420)
      (flat ? sum_flat : sum_any)(shuffled, num_shuffled, place, scratch);
    else
      clear_pair(i420, place, scratch);
    for (int i = 0; i < num_slow; i++)
      if (alone || !add_part(task, slow[i], place, scratch))
        add_mixed_block(task, *slow[i].weights, pair, x, out, rect.y1, y, scratch);
  }
}

// All that is known of a slot in a band before any pixel of it is read.
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
  for (int i = 0; i < blocks; i++) render_block(task, rect, first_block + i, i, y, scratch);
}

void FindCalmRows(PixelFamily family, Slot& slot) { set_calm_rows(family, slot); }

const char* TargetName() { return hwy::TargetName(HWY_TARGET); }

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lf::simd {
HWY_EXPORT(RenderBand);
HWY_EXPORT(FindCalmRows);
HWY_EXPORT(TargetName);

void render_band(const SumTask& task, const Rect& rect, int y, Scratch& scratch) {
  try {
    HWY_DYNAMIC_DISPATCH(RenderBand)(task, rect, y, scratch);
  } catch (...) {  // out of memory: what has some of it by now does not know what it lacks
    scratch = {};
    throw;
  }
}
void find_calm_rows(PixelFamily family, Slot& slot) { HWY_DYNAMIC_DISPATCH(FindCalmRows)(family, slot); }
const char* target_name() { return HWY_DYNAMIC_DISPATCH(TargetName)(); }

void PlanePositions::resize(size_t n) {
  node_x.resize(n);
  node_y.resize(n);
  window.resize(n);
  corner.resize(n);
  fetch.resize(n);
}

void CellNodes::resize(size_t n) {
  for (auto& row : even) row.resize(std::max(row.size(), n));
  for (auto& row : odd) row.resize(std::max(row.size(), n));
}

void CellWork::resize(size_t n) {
  if (doubt.even[0].size() >= n) return;
  for (CellNodes* nodes : {&along_x, &along_y, &down_x, &down_y, &doubt}) nodes->resize(n);
}

void SurfaceBand::resize(int blocks) {
  constexpr int kLanes = 2 * kBlock;  // of any vector, twice: nodes to the right of the last half are looked at
  const int wanted = (2 * blocks + kLanes - 1) / kLanes * kLanes + kLanes;
  if (pitch >= wanted) return;
  pitch = wanted;
  const size_t halves = pitch, cells = halves * kCellRows, rows = halves * kBandRows;
  for (CellNodes* of : {&x, &y, &z, &per_z}) of->resize(halves);
  for (auto* of : {&low_x, &high_x, &low_y, &high_y, &slack_x, &slack_y}) of->resize(cells);
  for (auto* of : {&nodes, &along, &down}) of->resize(8 * cells);
  luma_corner.resize(rows);
  luma_origin.resize(rows);
  chroma_corner.resize(rows / 4);
  chroma_origin.resize(rows / 4);
  calm_pairs.resize(halves / 2);
}
}  // namespace lf::simd
#endif
