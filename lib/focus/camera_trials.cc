// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/camera_trials.h"

#include <algorithm>

#include "focus/boxed_luma.h"
#include "focus/trial_nodes.h"
#include "render/contribution.h"
#include "render/source_region.h"

namespace lf {
namespace {

CameraTrials sample_camera(const RenderJob& job, const Source& source, std::span<const std::vector<uint8_t>> trials) {
  const TrialCamera where(job, source.camera, *source.rig_camera);
  CameraTrials out{.camera = source.camera, .rect = where.rect, .luma = {}};
  if (where.rect.empty()) return out;
  Rect region = needed_pixels(job.plan(), source.camera, *source.rig_camera, trials);
  if (region.empty()) region = {0, 0, 1, 1};  // all of it is lost weight
  BoxedLuma boxed;
  box_luma(source.image, region, boxed);
  const TrialLuma luma{boxed.values.data(), static_cast<float>(boxed.rect.x0) + 0.5f,
                       static_cast<float>(boxed.rect.y0) + 0.5f, boxed.rect.width(), boxed.rect.height()};
  const auto columns = static_cast<size_t>(job.plan().view().width);
  const int width = where.rect.width();
  out.luma.assign(trials.size(), std::vector<uint8_t>(static_cast<size_t>(width) * where.rect.height()));
  // With a weight of 1 sums are the values themselves.
  const std::vector<float> one(columns, 1);
  Moments row;
  TrialRow nodes(job);
  for (int y = where.rect.y0; y < where.rect.y1; y++) {
    nodes.begin(y);
    TrialNodes seen = nodes.find(where);
    seen.weight = one.data();
    for (size_t t = 0; t < trials.size(); t++) {
      row.reset(static_cast<int>(columns), 1);
      const TrialSums sums{&trials[t][static_cast<size_t>(y) * columns], row.weight.data(), row.luma.data(),
                           row.square.data()};
      add_trials(where.projection, seen, luma, &sums, 1);
      uint8_t* const to = &out.luma[t][static_cast<size_t>(y - where.rect.y0) * width];
      for (int x = 0; x < width; x++) to[x] = static_cast<uint8_t>(row.luma[where.rect.x0 + x] / Moments::kLumaOne);
    }
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
  for_trial_nodes(job, where, trials, 0, job.plan().view().height,
                  [&](size_t t, size_t node, float weight, float, float) {
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
