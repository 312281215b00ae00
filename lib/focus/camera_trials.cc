// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/camera_trials.h"

#include <algorithm>

#include "focus/trial_nodes.h"
#include "focus/trial_samples.h"
#include "render/contribution.h"

namespace lf {
namespace {

CameraTrials sample_camera(const RenderJob& job, const Source& source, std::span<const std::vector<uint8_t>> trials) {
  const TrialCamera where(job, source.camera, *source.rig_camera);
  CameraTrials out{.camera = source.camera, .rect = where.rect, .luma = {}};
  if (where.rect.empty()) return out;
  const TrialValues values =
      see_trials(where.projection, where.rays(), where.levels_of(trials, job.plan().view().width), source.image);
  for (size_t t = 0; t < trials.size(); t++) {
    std::vector<uint8_t>& luma = out.luma.emplace_back(static_cast<size_t>(out.rect.width()) * out.rect.height());
    for (const TrialRow& row : where.rows)
      for (int x = std::max(row.x0, out.rect.x0); x < std::min(row.x1, out.rect.x1); x++)
        luma[plain::rect_offset(out.rect, x, row.y)] =
            static_cast<uint8_t>(std::max<int>(values[t * where.u.size() + row.first + x - row.x0], 0));
  }
  return out;
}

}  // namespace

std::vector<CameraTrials> sample_trials(const RenderJob& job, std::span<const Source> sources,
                                        std::span<const std::vector<uint8_t>> trials, const ParallelFor& parallel) {
  std::vector<const Source*> seeing;
  for (const Source& source : sources) {
    if (source.image.family == PixelFamily::kNone || job.plan().camera_rect(source.camera).empty()) continue;
    plain::check_image(*source.rig_camera, source.image);
    seeing.push_back(&source);
  }
  std::vector<CameraTrials> out(seeing.size());
  parallel(seeing.size(), [&](size_t i) { out[i] = sample_camera(job, *seeing[i], trials); });
  std::erase_if(out, [](const CameraTrials& camera) { return camera.rect.empty(); });
  return out;
}

bool add_camera_trials(const RenderJob& job, const Camera& rig_camera, const CameraTrials& seen,
                       std::span<const std::vector<uint8_t>> trials, std::span<Moments> sums) {
  if (seen.luma.size() != trials.size() || seen.camera >= job.plan().num_cameras()) return false;
  if (job.plan().camera_rect(seen.camera).empty()) return false;
  const TrialCamera where(job, seen.camera, rig_camera);
  if (where.rect != seen.rect) return false;
  const auto add = [](uint16_t& sum, float value) {
    sum = static_cast<uint16_t>(std::min(sum + static_cast<int>(value + 0.5f), 65535));
  };
  const int columns = job.plan().view().width;
  for_trial_nodes(where, columns, trials, [&](size_t t, size_t node, float weight, float, float) {
    const int x = static_cast<int>(node) % columns, y = static_cast<int>(node) / columns;
    const auto value = static_cast<float>(seen.luma[t][plain::rect_offset(seen.rect, x, y)]);
    const float weighted = weight * value;
    add(sums[t].weight[node], weight * Moments::kWeightOne);
    add(sums[t].luma[node], weighted * Moments::kLumaOne);
    add(sums[t].square[node], weighted * value);
  });
  return true;
}

}  // namespace lf
