// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/trial_renderer.h"

#include <memory>

#include "focus/trial_nodes.h"
#include "focus/trial_samples.h"
#include "render/sampler.h"

namespace lf {
namespace {

// What a camera adds to the sums, of its nodes.
struct Seen {
  Seen(const RenderJob& job, const Source& source, std::span<const std::vector<uint8_t>> trials)
      : where(job, source.camera, *source.rig_camera) {
    if (where.rows.empty()) return;
    const TrialValues values =
        see_trials(where.projection, where.rays(), where.levels_of(trials, job.plan().view().width), source.image);
    stride = where.u.size();
    memory.resize(3 * stride * trials.size());
    for (size_t t = 0; t < trials.size(); t++)
      weigh_trial(where.weight.data(), &values[t * stride], where.rays().count, of_trial(t));
  }
  TrialSums of_trial(size_t trial) {
    uint16_t* const begin = memory.data() + 3 * stride * trial;
    return {begin, begin + stride, begin + 2 * stride};
  }
  TrialCamera where;
  size_t stride = 0;
  UninitializedVector<uint16_t> memory;
};

}  // namespace

void add_moments(const RenderJob& job, std::span<const Source> sources, std::span<const std::vector<uint8_t>> trials,
                 std::span<Moments> sums, const ParallelFor& parallel) {
  std::vector<const Source*> seeing;
  for (const Source& source : sources) {
    if (source.image.family == PixelFamily::kNone || job.plan().camera_rect(source.camera).empty()) continue;
    plain::check_image(*source.rig_camera, source.image);
    seeing.push_back(&source);
  }
  std::vector<std::unique_ptr<Seen>> cameras(seeing.size());
  parallel(seeing.size(), [&](size_t i) { cameras[i] = std::make_unique<Seen>(job, *seeing[i], trials); });
  // The order of saturating sums of what is not negative does not matter.
  parallel(trials.size(), [&](size_t t) {
    for (const std::unique_ptr<Seen>& camera : cameras)
      add_rows(camera->where.rows, camera->of_trial(t), sums[t].columns, sums[t].weight.size(),
               {sums[t].weight.data(), sums[t].luma.data(), sums[t].square.data()});
  });
}

}  // namespace lf
