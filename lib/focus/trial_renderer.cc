// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/trial_renderer.h"

#include <algorithm>
#include <memory>

#include "focus/boxed_luma.h"
#include "focus/trial_nodes.h"
#include "render/contribution.h"
#include "render/source_region.h"

namespace lf {
namespace {

// A camera and its luma.
struct Sampled {
  Sampled(const RenderJob& job, const Source& source, std::span<const std::vector<uint8_t>> trials)
      : where(job, source.camera, *source.rig_camera) {
    if (where.rect.empty()) return;
    Rect region = needed_pixels(job.plan(), source.camera, *source.rig_camera, trials);
    if (region.empty()) region = {0, 0, 1, 1};  // all of it is lost weight
    box_luma(source.image, region, boxed);
    luma = {.values = boxed.values.data(),
            .left = static_cast<float>(boxed.rect.x0) + 0.5f,
            .top = static_cast<float>(boxed.rect.y0) + 0.5f,
            .width = boxed.rect.width(),
            .height = boxed.rect.height()};
  }
  TrialCamera where;
  BoxedLuma boxed;
  TrialLuma luma{};
};

}  // namespace

void add_moments(const RenderJob& job, std::span<const Source> sources, std::span<const std::vector<uint8_t>> trials,
                 std::span<Moments> sums, const ParallelFor& parallel) {
  const ViewPlan& plan = job.plan();
  const FocalMap& map = *plan.view().focus.map;
  std::vector<const Source*> seeing;
  for (const Source& source : sources) {
    if (source.image.family == PixelFamily::kNone || plan.camera_rect(source.camera).empty()) continue;
    plain::check_image(*source.rig_camera, source.image);
    seeing.push_back(&source);
  }
  std::vector<std::unique_ptr<Sampled>> cameras(seeing.size());
  parallel(seeing.size(), [&](size_t i) { cameras[i] = std::make_unique<Sampled>(job, *seeing[i], trials); });
  constexpr int kRows = 8;  // of a task
  parallel(static_cast<size_t>((map.rows + kRows - 1) / kRows), [&](size_t band) {
    TrialRow nodes(job);
    std::vector<TrialSums> row_sums(trials.size());
    const int first = static_cast<int>(band) * kRows, last = std::min(first + kRows, map.rows);
    for (int row = first; row < last; row++) {
      nodes.begin(row);
      for (const std::unique_ptr<Sampled>& camera : cameras) {
        if (row < camera->where.rect.y0 || row >= camera->where.rect.y1) continue;
        const TrialNodes seen = nodes.find(camera->where);
        const size_t offset = static_cast<size_t>(row) * map.columns;
        for (size_t t = 0; t < trials.size(); t++)
          row_sums[t] = {&trials[t][offset], &sums[t].weight[offset], &sums[t].luma[offset], &sums[t].square[offset]};
        add_trials(camera->where.projection, seen, camera->luma, row_sums.data(), static_cast<int>(row_sums.size()));
      }
    }
  });
}

}  // namespace lf
