// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/fragment_set.h"

#include "render/simd/sum_task.h"

namespace lf {

struct FragmentSet::State : simd::PreparedTask {
  using PreparedTask::PreparedTask;
};

FragmentSet::FragmentSet() = default;
FragmentSet::~FragmentSet() = default;

void FragmentSet::begin(const ViewPlan& plan, const OwnerRuns& runs, std::span<const Source> sources,
                        PixelFamily family, Coordinates coordinates) {
  state_ = std::make_unique<State>(plan, runs, sources, family, coordinates);
  simd::SumTask& task = state_->task;
  const bool i420 = family == PixelFamily::kI420;
  any_lost_ = std::vector<std::atomic<bool>>(task.slots.size());
  task.targets.resize(task.slots.size());

  // Whole blocks and pairs of rows; offsets first, the memory when all are known.
  size_t size = 0;
  std::vector<std::array<size_t, 4>> offsets(task.slots.size());
  for (size_t i = 0; i < task.slots.size(); i++) {
    const Rect& rect = task.slots[i].rect;
    simd::SlotTarget& target = task.targets[i];
    target.first_block = rect.x0 / simd::kBlock;
    target.blocks = (rect.x1 + simd::kBlock - 1) / simd::kBlock - target.first_block;
    target.y0 = rect.y0 & ~1;
    target.y1 = (rect.y1 + 1) & ~1;
    const ptrdiff_t width = ptrdiff_t{target.blocks} * simd::kBlock;
    const auto take = [&](ptrdiff_t stride, int rows) {
      const size_t at = size;
      size += static_cast<size_t>(stride) * static_cast<size_t>(rows);
      return at;
    };
    const int rows = target.y1 - target.y0;
    target.stride[0] = i420 ? width : 3 * width;
    target.stride[1] = target.stride[2] = width / 2;
    target.lost_stride = width;
    offsets[i][0] = take(target.stride[0], rows);
    for (int c = 1; c < 3 && i420; c++) offsets[i][c] = take(target.stride[c], rows / 2);
    if (!task.slots[i].is_calm()) offsets[i][3] = take(width, rows);
  }
  memory_.resize(size);
  for (size_t i = 0; i < task.slots.size(); i++) {
    simd::SlotTarget& target = task.targets[i];
    for (int c = 0; c < (i420 ? 3 : 1); c++) target.plane[c] = memory_.data() + offsets[i][c];
    if (!task.slots[i].is_calm()) target.lost = memory_.data() + offsets[i][3];
    target.any_lost = &any_lost_[i];
  }
  rect_ = state_->rect;
  rect_.y0 &= ~1;
}

void FragmentSet::render_rows(int y0, int y1) {
  const simd::SumTask& task = state_->task;
  simd::Scratch& scratch = simd::scratch_for(rect_, task.slots.size());
  for (int y = y0 / simd::kBandRows * simd::kBandRows; y < y1; y += simd::kBandRows)
    simd::render_band(task, {rect_.x0, y0, rect_.x1, std::min(y1, rect_.y1)}, y, scratch);
}

const std::vector<CameraFragment>& FragmentSet::fragments() {
  const simd::SumTask& task = state_->task;
  const ViewPlan& plan = *task.plan;
  const bool i420 = task.family == PixelFamily::kI420;
  const std::vector<Rect> rects = owned_rects(plan, *task.runs);
  fragments_.clear();
  for (size_t i = 0; i < task.slots.size(); i++) {
    const CameraIndex camera = task.slots[i].camera;
    Rect rect = rects[camera];
    if (rect.empty()) continue;
    if (i420) rect = chroma_aligned(rect, plan.view());
    const simd::SlotTarget& from = task.targets[i];
    const int x = rect.x0 - from.first_block * simd::kBlock, y = rect.y0 - from.y0;
    FragmentPlanes planes{.family = task.family, .rect = rect};
    for (int c = 0; c < (i420 ? 3 : 1); c++) {
      planes.stride[c] = from.stride[c];
      planes.plane[c] =
          from.plane[c] + (i420 && c > 0 ? y / 2 * from.stride[c] + x / 2 : y * from.stride[c] + (i420 ? x : 3 * x));
    }
    if (any_lost_[i]) {
      planes.lost = from.lost + y * from.lost_stride + x;
      planes.lost_stride = from.lost_stride;
    }
    fragments_.push_back({camera, planes});
  }
  return fragments_;
}

}  // namespace lf
