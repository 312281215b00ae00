// SPDX-License-Identifier: LGPL-2.1-or-later
// Per target, see render_band.cc: a band between the nodes of a focal map, in one camera's image.
#if defined(LF_RENDER_SIMD_SURFACE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_RENDER_SIMD_SURFACE_INL_H_
#undef LF_RENDER_SIMD_SURFACE_INL_H_
#else
#define LF_RENDER_SIMD_SURFACE_INL_H_
#endif

#include <algorithm>

#include <hwy/highway.h>

#include "render/simd/band_data.h"
#include "render/simd/cells-inl.h"
#if HWY_TARGET != HWY_SCALAR
#include "render/simd/cell_windows-inl.h"
#include "render/simd/fixed_cells-inl.h"
#endif

HWY_BEFORE_NAMESPACE();
namespace lf::simd::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET != HWY_SCALAR

// Where a map with nodes kCell apart is.
inline void place_cells(const Slot& slot, bool i420, int y, bool follows, const CellNodes& inverse, CellWork& work,
                        SlotBand& band) {
  SurfaceBand& out = band.surface;
  work.resize(out.pitch);
  const size_t halves = 2 * static_cast<size_t>(band.blocks), first = 2 * static_cast<size_t>(band.first_block);
  const int ready = follows ? kCellRows - kBandRows / kCell : 0;  // rows of nodes
  const int ready_cells = std::max(ready - 1, 0);
  out.first_row = (y / kCell + kCellRows - 1) % kCellRows;
  project_cells(slot, inverse, first, halves + 1, y, ready, out, work);
  doubt_cells(slot, inverse, first, halves + 1, ready_cells, out, work.doubt);
  for (int k = ready; k < kCellRows; k++) fix_nodes(work, k, halves, out);
  for (int k = ready_cells; k + 1 < kCellRows; k++) fix_cells(work, k, halves, out);
  decide_cells(slot, i420, band);
}

#else

// A machine without vectors goes the slow way everywhere.
inline void place_cells(const Slot&, bool, int, bool, const CellNodes&, CellWork&, SlotBand& band) {
  std::ranges::fill(band.verdict, SlotBand::kProject);
  std::ranges::fill(band.surface.calm_pairs, 0);
}

#endif

// All that is known of a slot in a band before any pixel of it is read. band's blocks are set. `follows`: on the band
// that is there already. `inverse`: null: of another map, all is to be projected.
inline void place_surface(bool i420, const Slot& slot, int y, bool follows, const CellNodes* inverse, CellWork& work,
                          SlotBand& band) {
  SurfaceBand& out = band.surface;
  band.calm = false;
  band.mapped = true;
  out.resize(band.blocks);
  band.verdict_pitch = out.pitch / 2;
  band.verdict.resize(std::max(band.verdict.size(), static_cast<size_t>(band.verdict_pitch) * kBandPairs));
  if (inverse) return place_cells(slot, i420, y, follows, *inverse, work, band);
  std::ranges::fill(band.verdict, SlotBand::kProject);
  std::ranges::fill(out.calm_pairs, 0);
}

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
