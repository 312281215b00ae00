// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/view_focus.h"

#include <map>
#include <numeric>
#include <utility>

#include "focus/carry_over.h"
#include "focus/trial_renderer.h"

namespace lf {

void apply_plan(const FocusControl::Plan& plan, ViewRequest& request) {
  const View& view = request.view;
  // A mean of another size is of no use.
  if (view.width != plan.view.width || view.height != plan.view.height) request.gains.mean.clear();
  const bool serves = !request.trials.empty() || request.gains.ask || !request.gains.mean.empty();
  if (plan.plane) request.view.focus.plane = *plan.plane;
  request.on_plane = plan.on_plane && serves;
  if (!plan.on_plane || serves) request.view.focus.map = carry_over(plan.view, view);
}

GainRequest next_gains(MeanTurns& turns, bool use, bool has_trials, const Moments& brightness, const GainSum& gains,
                       uint32_t sequence) {
  GainRequest next{.use = use};
  if (!use) {
    turns = {};
    return next;
  }
  const bool came = brightness.columns > 0;
  next.ask = turns.next(has_trials, came);
  if (!came) return next;
  next.mean = mean_luma(brightness, gains);
  next.mean_of = sequence;
  return next;
}

void ViewFocus::apply(ViewRequest& request) {
  if (!plan_ || !plan_->view.focus.map) return;
  request.trials = std::exchange(plan_->trials, {});
  request.gains = std::exchange(gains_, {.use = gains_.use});
  apply_plan(*plan_, request);
}

void ViewFocus::take(const ViewRequest& request, const Answers& answers, const FocusArray& array) {
  control_.keep_up(answers.complete);
  plan_ = control_.next(request, answers.moments, array);
  gains_ = next_gains(turns_, match_gains_ && control_.state().mixed, !plan_->trials.empty(), answers.brightness,
                      answers.gains, request.sequence);
}

View focus_still(const Rig& rig, const Mesh& mesh, const View& view, const CameraImages& images,
                 const FocusControl::Settings& settings, int rounds) {
  std::vector<CameraIndex> all(rig.cameras.size());
  std::iota(all.begin(), all.end(), 0);
  const FocusArray array(rig, mesh);
  std::map<CameraIndex, Image> kept;  // an image given is only good until the next one
  ViewFocus focus(settings);
  const auto next_request = [&] {
    ViewRequest request;
    request.view = view;
    request.view.focus.map = nullptr;
    focus.apply(request);
    return request;
  };
  for (int round = 0; round <= rounds; round++) {
    const ViewRequest request = next_request();
    ViewFocus::Answers answers;
    std::vector<Moments>& sums = answers.moments;
    sums.resize(request.trials.size());
    if (!sums.empty()) {
      std::vector<std::vector<uint8_t>> levels;
      for (const Trial& trial : request.trials) levels.push_back(trial_levels(request.view, trial));
      for (Moments& sum : sums) sum.reset(request.view.focus.map->columns, request.view.focus.map->rows);
      const RenderJob job(rig, mesh, trial_view(request.view), all);
      std::vector<Source> sources;
      for (const CameraIndex camera : job.cameras()) {
        if (!kept.contains(camera)) kept[camera] = images(camera);
        sources.push_back({camera, &rig.cameras[camera], kept[camera].view()});
      }
      add_moments(job, sources, levels, sums);
    }
    focus.take(request, answers, array);
  }
  return shown_view(next_request());
}

}  // namespace lf
