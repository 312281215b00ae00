// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "bench/focus_situation.h"
#include "composite/accumulator.h"
#include "focus/carry_over.h"
#include "focus/trial_renderer.h"
#include "image/sharpen.h"
#include "quality/quality.h"
#include "render/contribution_map.h"
#include "render/render_job.h"
#include "render/source_region.h"
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
    for (size_t i = 0; i < own_.size(); i++) {
      const Image& image = s.images[i];
      const ImageView sharpened = sharpen(image.view(), {0, 0, image.width(), image.height()}, sharp_[i]);
      sources_.push_back({own_[i], &s.rig.cameras[i], sharpened});
    }
  }

  Picture picture(const View& view) const {
    const RenderJob job(s_.rig, mesh_, view, own_);
    std::vector<Source> sources;
    for (const CameraIndex i : job.cameras()) sources.push_back(sources_[i]);
    const SumRenderer renderer(job.plan(), job.runs(), sources, PixelFamily::kRgb);
    const Rect rect = renderer.rect();
    const size_t area = static_cast<size_t>(rect.width()) * rect.height();
    std::vector<int16_t> samples(3 * area);
    std::vector<uint16_t> lost(area);
    const bool any_lost =
        renderer.render_rows(rect.y0, rect.y1, packed_sums(PixelFamily::kRgb, rect, samples.data(), lost.data()));
    Accumulator sum;
    sum.reset(PixelFamily::kRgb, view.width, view.height);
    sum.add(packed_sums<const int16_t, const uint16_t>(PixelFamily::kRgb, rect, samples.data(),
                                                       any_lost ? lost.data() : nullptr));
    return {sum.resolve(), view_coverage(s_.rig, job.plan(), job.owners())};
  }

  std::vector<Moments> moments(const ViewRequest& request) const {
    if (request.trials.empty() || !request.view.focus.map) return {};
    const FocalMap& map = *request.view.focus.map;
    std::vector<std::vector<uint8_t>> levels;
    for (const Trial& trial : request.trials) levels.push_back(trial_levels(request.view, trial));
    std::vector<Moments> sums(levels.size());
    for (Moments& sum : sums) sum.reset(map.columns, map.rows);
    const RenderJob job(s_.rig, mesh_, trial_view(request.view), own_);
    std::vector<Source> sources;
    for (const CameraIndex i : job.cameras()) sources.push_back({i, &s_.rig.cameras[i], s_.images[i].view()});
    add_moments(job, sources, levels, sums);
    return sums;
  }

 private:
  const Situation& s_;
  const Mesh mesh_;
  std::vector<CameraIndex> own_;
  std::vector<ByteBuffer> sharp_;
  std::vector<Source> sources_;
};

}  // namespace

Watched watch(const Situation& s, const std::vector<int>& pictures) {
  const Array array(s);
  const FocusArray from(s.rig);
  FocusControl control({.mode = s.mode});
  Watched out;
  double worst = std::numeric_limits<double>::infinity();
  FocusControl::Plan plan;
  Picture plane;
  Image truth;
  for (int i = 0; i <= pictures.back(); i++) {
    ViewRequest request;
    request.view = s.view(i);
    if (i > 0) {
      if (plan.view.focus.map) request.view.focus.map = carry_over(plan.view, request.view);
      request.trials = plan.trials;
      request.on_plane = plan.on_plane;
      if (plan.plane) request.view.focus.plane = *plan.plane;
    }
    if (std::ranges::binary_search(pictures, i)) {
      if (plane.coverage.empty() || s.moves) {
        truth = s.truth(request.view);
        plane = array.picture(s.view(i));
      }
      const Picture surface = array.picture(shown_view(request));
      std::vector<float> coverage = plane.coverage;
      for (size_t k = 0; k < coverage.size(); k++) coverage[k] = std::min(coverage[k], surface.coverage[k]);
      const Quality of_plane = compare(plane.image, truth, coverage), of_surface = compare(surface.image, truth, coverage);
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
    plan = control.next(request, array.moments(request), from);
  }
  return out;
}

}  // namespace lf::focus
