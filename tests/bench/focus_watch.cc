// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "bench/focus_situation.h"
#include "bench/sum_picture.h"
#include "focus/camera_gains.h"
#include "focus/carry_over.h"
#include "focus/trial_renderer.h"
#include "image/correction.h"
#include "node/gain_matcher.h"
#include "quality/quality.h"
#include "render/camera_projection.h"
#include "render/contribution_map.h"
#include "render/ownership.h"
#include "render/sum_renderer.h"

namespace lf::focus {
namespace {

struct Picture {
  Image image;
  std::vector<float> coverage;
};

// Everything a node of all cameras and a compositor do for a view, in one thread.
class Array {
 public:
  explicit Array(const Situation& s) : s_(s), mesh_(build_mesh(s.rig)) {
    own_.resize(s.rig.cameras.size());
    std::iota(own_.begin(), own_.end(), 0);
    sharp_.resize(own_.size());
  }

  // `gains`: null: the cameras' brightness is left as it is.
  Picture picture(const View& view, const GainRequest* gains) {
    const RenderJob job(s_.rig, mesh_, view, own_);
    std::vector<Source> sources = sources_of(job.cameras());
    if (gains && gains->use) sources = match(sources, *gains);
    for (size_t i = 0; i < sources.size(); i++)
      if (shows_detail(view, *sources[i].rig_camera))
        sources[i].image = sharpen(sources[i].image, whole(sources[i].camera), sharp_[i]);
    const SumRenderer renderer(job.plan(), job.runs(), sources, PixelFamily::kRgb);
    return {bench::picture_of_sums(renderer, view.width, view.height).image,
            view_coverage(s_.rig, job.plan(), job.owners())};
  }

  std::vector<Moments> moments(const ViewRequest& request) {
    if (request.trials.empty() || !request.view.focus.map) return {};
    const FocalMap& map = *request.view.focus.map;
    std::vector<std::vector<uint8_t>> levels;
    for (const Trial& trial : request.trials) levels.push_back(trial_levels(request.view, trial));
    std::vector<Moments> sums(levels.size());
    for (Moments& sum : sums) sum.reset(map.columns, map.rows);
    const RenderJob job(s_.rig, mesh_, trial_view(request.view), own_);
    const std::vector<Source> sources = sources_of(job.cameras());
    add_moments(job, request.gains.use ? match(sources, request.gains) : sources, levels, sums);
    return sums;
  }

  // What the next request brings back of the cameras' brightness.
  void ask_mean(const ViewRequest& request, GainRequest& gains) {
    if (!turns_.next(!request.trials.empty(), true)) return;
    const WideLuma wide(s_.rig, mesh_, mean_view(request.view), own_);
    WideLuma::Seen seen = wide.see(sources_of(wide.cameras()), matcher_.gains_for(0, {}));
    gains.mean = mean_luma(seen.moments, seen.gains);
    gains.mean_of = request.sequence;
    matcher_.keep(0, request.sequence, std::move(seen.cameras));
  }

 private:
  Rect whole(CameraIndex camera) const { return {0, 0, s_.rig.cameras[camera].width, s_.rig.cameras[camera].height}; }
  std::vector<Source> sources_of(const std::vector<CameraIndex>& cameras) const {
    std::vector<Source> sources;
    for (const CameraIndex i : cameras) sources.push_back({i, &s_.rig.cameras[i], s_.images[i].view()});
    return sources;
  }
  std::vector<Source> match(const std::vector<Source>& sources, const GainRequest& gains) {
    const auto all = [&](CameraIndex camera) { return whole(camera); };
    return GainMatcher::match(sources, matcher_.gains_for(0, gains), all, divided_);
  }

  const Situation& s_;
  const Mesh mesh_;
  std::vector<CameraIndex> own_;
  std::vector<ByteBuffer> sharp_;
  std::vector<ByteBuffer> divided_;
  GainMatcher matcher_;
  MeanTurns turns_;
};

}  // namespace

Watched watch(const Situation& s, const std::vector<int>& pictures) {
  Array array(s);
  const FocusArray from(s.rig);
  FocusControl control({.mode = s.mode});
  Watched out;
  double worst = std::numeric_limits<double>::infinity();
  FocusControl::Plan plan;
  GainRequest gains;
  Picture plane;
  Image truth;
  for (int i = 0; i <= pictures.back(); i++) {
    ViewRequest request;
    request.view = s.view(i);
    request.sequence = static_cast<uint32_t>(i);
    request.gains = gains;
    if (i > 0) {
      if (plan.view.focus.map) request.view.focus.map = carry_over(plan.view, request.view);
      request.trials = plan.trials;
      request.on_plane = plan.on_plane;
      if (plan.plane) request.view.focus.plane = *plan.plane;
    }
    if (std::ranges::binary_search(pictures, i)) {
      if (plane.coverage.empty() || s.moves) {
        truth = s.truth(request.view);
        plane = array.picture(s.view(i), nullptr);
      }
      const Picture surface = array.picture(shown_view(request), &request.gains);
      std::vector<float> coverage = plane.coverage;
      for (size_t k = 0; k < coverage.size(); k++) coverage[k] = std::min(coverage[k], surface.coverage[k]);
      const Quality of_plane = compare(plane.image, truth, coverage),
                    of_surface = compare(surface.image, truth, coverage);
      constexpr double kSome = 0.05;
      if (of_plane.coverage >= kSome) {
        out.seen.push_back({i, of_plane.psnr_db, of_surface.psnr_db, control.state().near, control.state().far});
        if (of_surface.psnr_db - of_plane.psnr_db < worst) {
          worst = of_surface.psnr_db - of_plane.psnr_db;
          out.worst = static_cast<int>(out.seen.size()) - 1;
          out.truth = truth;
          out.plane = plane.image;
          out.surface = surface.image;
        }
      }
    }
    const std::vector<Moments> moments = array.moments(request);
    gains = {.use = control.state().mixed};
    if (gains.use && request.view.focus.map) array.ask_mean(request, gains);
    plan = control.next(request, moments, from);
  }
  return out;
}

}  // namespace lf::focus
