// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/view_depths.h"

#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "focus/hypothesis_renderer.h"
#include "focus/warp_depth_map.h"
#include "image/image_filters.h"

namespace lf {

void apply_plan(const DepthEstimator::Plan& plan, ViewRequest& request) {
  const View& view = request.view;
  // A mean of another size is useless.
  if (view.width != plan.view.width || view.height != plan.view.height) request.gains.mean.clear();
  const bool serves = !request.hypotheses.empty() || request.gains.ask || !request.gains.mean.empty();
  if (plan.plane) request.view.focus.plane = *plan.plane;
  request.on_plane = plan.on_plane && serves;
  if (!plan.on_plane || serves) request.view.focus.map = warp_depth_map(plan.view, view);
  if (request.view.focus.map) return;
  // A view that is too large for a map cannot use hypotheses or a mean.
  request.hypotheses.clear();
  request.gains.ask = request.on_plane = false;
}

void apply_reference_view(const ViewRequest& leader, ViewRequest& beside) {
  beside.view.focus.plane = leader.view.focus.plane;
  const bool has_surface = leader.view.focus.map && !leader.on_plane;
  beside.view.focus.map = has_surface ? warp_depth_map(leader.view, beside.view) : nullptr;
  beside.on_plane = false;
  beside.hypotheses.clear();
  beside.gains = {.use = leader.gains.use};
}

GainRequest next_gains(ExposureSchedule& turns, bool use, bool has_hypotheses, const PhotoConsistency& brightness,
                       const GainSum& gains, uint32_t sequence) {
  GainRequest next{.use = use};
  if (!use) {
    turns = {};
    return next;
  }
  const bool came = brightness.columns > 0;
  next.ask = turns.next(has_hypotheses, came);
  if (!came) return next;
  next.mean = mean_luma(brightness, gains);
  next.mean_of = sequence;
  return next;
}

void ViewDepths::apply(ViewRequest& request) {
  if (!plan_ || !plan_->view.focus.map) return;
  request.hypotheses = std::exchange(plan_->hypotheses, {});
  request.gains = std::exchange(gains_, {.use = gains_.use});
  apply_plan(*plan_, request);
}

void ViewDepths::take(const ViewRequest& request, const Answers& answers, const FocusArray& array) {
  control_.keep_up(answers.complete);
  plan_ = control_.next(request, answers.moments, array);
  gains_ = next_gains(turns_, match_gains_ && control_.state().mixed, !plan_->hypotheses.empty(), answers.brightness,
                      answers.gains, request.sequence);
}

namespace {

class StillArray {
 public:
  StillArray(const Rig& rig, const Mesh& mesh, const CameraImages& images, ExposureCompensation* gains)
      : rig_(rig), mesh_(mesh), images_(images), gains_(gains) {
    all_.resize(rig.cameras.size());
    std::iota(all_.begin(), all_.end(), 0);
  }

  std::vector<PhotoConsistency> moments(const ViewRequest& request) {
    std::vector<PhotoConsistency> sums(request.hypotheses.size());
    if (sums.empty()) return sums;
    std::vector<std::vector<uint8_t>> levels;
    for (const DepthHypothesis& hypothesis : request.hypotheses)
      levels.push_back(hypothesis_levels(request.view, hypothesis));
    for (PhotoConsistency& sum : sums) sum.reset(request.view.focus.map->columns, request.view.focus.map->rows);
    const RenderJob job(rig_, mesh_, hypothesis_view(request.view), all_);
    std::vector<Source> sources = sources_of(job.cameras());
    std::vector<ByteBuffer> divided(sources.size());
    for (size_t i = 0; i < sources.size() && gains_ && request.gains.use; i++) {
      const float gain = gains_->of(sources[i].camera);
      if (std::abs(gain - 1) < kGainTolerance) continue;
      ImageView& image = sources[i].image;
      image = divide_by_gain(image, {0, 0, image.width, image.height}, gain, divided[i]);
    }
    add_consistency(job, sources, levels, sums);
    return sums;
  }

  void compare(const ViewRequest& request, ViewDepths::Answers& answers) {
    if (!gains_) return;
    if (!request.gains.mean.empty() && !seen_.empty())
      gains_->take(WideLuma::ratios(std::exchange(seen_, {}), request.gains.mean));
    if (!request.gains.ask) return;
    const WideLuma wide(rig_, mesh_, mean_view(request.view), all_);
    WideLuma::Seen seen = wide.see(sources_of(wide.cameras()), *gains_);
    answers.brightness = std::move(seen.moments);
    answers.gains = seen.gains;
    seen_ = std::move(seen.cameras);
  }

 private:
  std::vector<Source> sources_of(const std::vector<CameraIndex>& cameras) {
    std::vector<Source> sources;
    for (const CameraIndex camera : cameras) {
      if (!kept_.contains(camera)) kept_[camera] = images_(camera);
      sources.push_back({camera, &rig_.cameras[camera], kept_[camera].view()});
    }
    return sources;
  }

  const Rig& rig_;
  const Mesh& mesh_;
  const CameraImages& images_;
  ExposureCompensation* const gains_;
  std::vector<CameraIndex> all_;
  std::map<CameraIndex, Image> kept_;  // an image from images_ is valid until the next call only
  std::vector<WideLuma::Camera> seen_;
};

}  // namespace

View focus_still(const Rig& rig, const Mesh& mesh, const View& view, const CameraImages& images,
                 const DepthEstimator::Settings& settings, int rounds, ExposureCompensation* gains) {
  const FocusArray array(rig, mesh);
  StillArray still(rig, mesh, images, gains);
  ViewDepths focus(settings, gains != nullptr);
  const auto next_request = [&] {
    ViewRequest request;
    request.view = view;
    request.view.focus.map = nullptr;
    focus.apply(request);
    return request;
  };
  for (int round = 0; round <= rounds; round++) {
    const ViewRequest request = next_request();
    ViewDepths::Answers answers;
    still.compare(request, answers);
    answers.moments = still.moments(request);
    focus.take(request, answers, array);
  }
  return displayed_view(next_request());
}

}  // namespace lf
