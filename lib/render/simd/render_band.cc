// SPDX-License-Identifier: LGPL-2.1-or-later
// Compiled once for each instruction set; the best one that the machine has runs.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/simd/render_band.cc"
#include <hwy/foreach_target.h>
// After foreach_target.h:
#include <hwy/highway.h>

#include <algorithm>

#include "render/simd/band_data.h"
#include "render/simd/positions-inl.h"
#include "render/simd/sums-inl.h"
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

inline void clear_rgb(const PairPlace& at, Scratch& scratch) {
  for (int r = 2 * at.pair; r < 2 * at.pair + 2; r++)
    for (int16_t* sum : scratch.sum[r]) std::fill_n(sum + at.out * kBlock, kBlock, 0);
}

inline constexpr int kMostParts = kBandRows * 3 * kBlock;  // three corners of a face for every pixel

// `block`: of the view; `out`: counted from the rectangle's first one; y: the band's first row.
inline void render_block(const SumTask& task, const Rect& rect, int block, int out, int y, Scratch& scratch) {
  const View& view = task.plan->view();
  const int x = block * kBlock;
  const bool i420 = task.family == PixelFamily::kI420, separable = task.plan->rays().separable();
  const bool odd_column = i420 && view.width % 2 != 0 && x + kBlock > view.width - 1;
  Part shuffled[kMostParts], slow[kMostParts];
  for (int pair = 0; pair < kBandPairs && y + 2 * pair < rect.y1; pair++) {
    const PairPlace place{pair, x, y, out};
    // A chroma sample at the border of an odd view has only two pixels, or one.
    const bool odd = odd_column || (i420 && y + 2 * pair + 1 >= view.height), alone = odd || !separable;
    int num_shuffled = 0, num_slow = 0;
    for (int32_t i = scratch.head[out]; i >= 0; i = scratch.weights[i].next) {
      const BlockWeights& weights = scratch.weights[i];
      if (!(weights.rows >> (2 * pair) & 3)) continue;
      const SlotBand& band = scratch.bands[weights.slot];
      Part part{&weights, &band, block - band.first_block, SlotBand::kProject};
      if (task.slots[weights.slot].image.family == PixelFamily::kNone)
        part.verdict = SlotBand::kAllLost;
      else if (!alone && task.slots[weights.slot].calm)
        part.verdict = SlotBand::kShuffle;
      else if (!alone)
        part.verdict = band.verdict[pair * band.pitch + part.block];
      if (part.verdict == SlotBand::kAllLost)
        add_lost(weights, place, scratch);
      else if (part.verdict == SlotBand::kShuffle && !task.exact && HWY_TARGET != HWY_SCALAR)
        shuffled[num_shuffled++] = part;
      else
        slow[num_slow++] = part;
    }
    if (i420)
      sum_i420(shuffled, num_shuffled, place, scratch);
    else
      clear_rgb(place, scratch);
    for (int i = 0; i < num_slow; i++)
      if (alone || !add_part(task, slow[i], place, scratch))
        add_mixed_block(task, *slow[i].weights, pair, x, out, rect.y1, y, scratch);
  }
}

void RenderBand(const SumTask& task, const Rect& rect, int y, Scratch& scratch) {
  weigh_band(task, rect, y, scratch);
  const int first_block = rect.x0 / kBlock, blocks = (rect.x1 + kBlock - 1) / kBlock - first_block;
  if (task.plan->rays().separable())
    for (size_t i = 0; i < scratch.weights_used; i++) {
      const int32_t number = scratch.weights[i].slot;
      const Slot& slot = task.slots[number];
      if (scratch.bands[number].y == y || slot.image.family == PixelFamily::kNone) continue;
      place_slot(task, slot, y, scratch.bands[number]);
    }
  for (uint16_t* lost : scratch.lost) std::fill_n(lost, blocks * kBlock, 0);
  for (int i = 0; i < blocks; i++) render_block(task, rect, first_block + i, i, y, scratch);
}

bool IsCalm(const Slot& slot, PixelFamily family) { return find_calm(slot, family); }

const char* TargetName() { return hwy::TargetName(HWY_TARGET); }

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lf::simd {
HWY_EXPORT(RenderBand);
HWY_EXPORT(IsCalm);
HWY_EXPORT(TargetName);

void render_band(const SumTask& task, const Rect& rect, int y, Scratch& scratch) {
  HWY_DYNAMIC_DISPATCH(RenderBand)(task, rect, y, scratch);
}
bool is_calm(const Slot& slot, PixelFamily family) { return HWY_DYNAMIC_DISPATCH(IsCalm)(slot, family); }
const char* target_name() { return HWY_DYNAMIC_DISPATCH(TargetName)(); }

void PlanePositions::resize(size_t n) {
  node_x.resize(n);
  node_y.resize(n);
  window.resize(n);
  corner.resize(n);
  fetch.resize(n);
}
}  // namespace lf::simd
#endif
