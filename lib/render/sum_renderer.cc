// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/sum_renderer.h"

#include <algorithm>

#include "render/simd/sum_task.h"

namespace lf {

struct SumRenderer::State : simd::PreparedTask {
  using PreparedTask::PreparedTask;
};

SumRenderer::SumRenderer(const ViewPlan& plan, const OwnerRuns& runs, std::span<const Source> sources,
                         PixelFamily family, Coordinates coordinates)
    : state_(std::make_unique<State>(plan, runs, sources, family, coordinates)), rect_(state_->rect) {}

SumRenderer::~SumRenderer() = default;

bool SumRenderer::render_rows(int y0, int y1, const SumPlanes& out) const {
  const simd::SumTask& task = state_->task;
  const Rect& rect = out.rect;
  const bool i420 = task.family == PixelFamily::kI420;
  const int skip = rect.x0 % simd::kBlock, chroma_width = chroma_size(rect.width());
  simd::Scratch& scratch = simd::scratch_for(rect, task.slots.size());

  // Whole blocks are written right where they belong.
  const bool direct = skip == 0 && rect.width() % simd::kBlock == 0;
  bool any_lost = false;
  for (int y = y0 / simd::kBandRows * simd::kBandRows; y < y1; y += simd::kBandRows) {
    const auto row_of = [&](int c, int r) {
      const int row = i420 && c > 0 ? (y - rect.y0) / 2 + r : y - rect.y0 + r;
      return out.plane[c] + row * out.stride[c];
    };
    const auto has = [&](int c, int r) {
      const int row = y + (i420 && c > 0 ? 2 * r : r);
      return row >= y0 && row < y1 && (c == 0 || !i420 || r < simd::kBandPairs);
    };
    for (int r = 0; r < simd::kBandRows; r++) {
      for (int c = 0; c < 3; c++)
        scratch.sum[r][c] = direct && has(c, r) ? row_of(c, r) : scratch.sum_memory[r][c].data();
      scratch.lost[r] = direct && out.lost && has(0, r) ? out.lost + (y - rect.y0 + r) * out.lost_stride
                                                        : scratch.lost_memory[r].data();
    }
    scratch.any_lost = false;
    simd::render_band(task, {rect.x0, y0, rect.x1, y1}, y, scratch);
    any_lost = any_lost || scratch.any_lost;
    if (direct) continue;
    for (int r = 0; r < simd::kBandRows; r++) {
      for (int c = 0; c < 3; c++)
        if (has(c, r))
          std::copy_n(scratch.sum[r][c] + (i420 && c > 0 ? skip / 2 : skip),
                      i420 && c > 0 ? chroma_width : rect.width(), row_of(c, r));
      if (out.lost && has(0, r))
        std::copy_n(scratch.lost[r] + skip, rect.width(), out.lost + (y - rect.y0 + r) * out.lost_stride);
    }
  }
  return any_lost;
}

const char* simd_target_name() { return simd::target_name(); }

}  // namespace lf
