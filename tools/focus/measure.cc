// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/measure.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/now.h"
#include "composite/accumulator.h"
#include "focus/array_plane.h"
#include "focus/carry_over.h"
#include "focus/trial_renderer.h"
#include "image/sharpen.h"
#include "render/contribution_map.h"
#include "render/render_job.h"
#include "render/source_region.h"
#include "render/sum_renderer.h"
#include "wire/moments_codec.h"

namespace lf::focus {
namespace {

double milliseconds(uint64_t ns) { return static_cast<double>(ns) / 1e6; }

// Everything a node and a compositor do for a view, in one thread and without a wire.
class Renderer {
 public:
  Renderer(const Case& c, bool sharpened) : case_(c), sharpened_(sharpened), mesh_(build_mesh(c.rig)) {
    own_.resize(c.rig.cameras.size());
    std::iota(own_.begin(), own_.end(), 0);
  }

  Picture picture(const View& view, size_t number) {
    Picture out;
    const RenderJob job(case_.rig, mesh_, view, own_);
    std::vector<Source> sources = sources_of(job, number);
    const uint64_t begun = now_ns();
    sharp_.resize(sharpened_ ? std::max(sharp_.size(), sources.size()) : 0);
    for (size_t i = 0; sharpened_ && i < sources.size(); i++)
      sources[i].image = sharpen(
          sources[i].image, needed_pixels(job.plan(), sources[i].camera, *sources[i].rig_camera), sharp_[i]);
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
    out.image = sum.resolve();
    out.colour_ms = milliseconds(now_ns() - begun);
    out.colour_bytes = static_cast<double>(2 * (samples.size() + (any_lost ? area : 0)));
    out.coverage = view_coverage(case_.rig, job.plan(), job.owners());
    return out;
  }

  std::vector<Moments> moments(const ViewRequest& request, size_t number, Picture& cost) {
    if (request.trials.empty()) return {};
    const uint64_t begun = now_ns();
    std::vector<std::vector<uint8_t>> levels;
    for (const Trial& trial : request.trials) levels.push_back(trial_levels(*request.view.focus.map, trial));
    std::vector<Moments> sums(levels.size());
    for (Moments& sum : sums) sum.reset(request.view.focus.map->columns, request.view.focus.map->rows);
    const RenderJob job(case_.rig, mesh_, trial_view(request.view), own_);
    const uint64_t planned = now_ns();
    const std::vector<Source> sources = sources_of(job, number);
    const uint64_t ready = now_ns();
    add_moments(job, sources, levels, sums);
    cost.trial_ms += milliseconds(now_ns() - ready + planned - begun);
    cost.trial_bytes += static_cast<double>(wire::encode_moments({}, sums).size());
    return sums;
  }

 private:
  std::vector<Source> sources_of(const RenderJob& job, size_t number) const {
    std::vector<Source> sources;
    for (const CameraIndex i : job.cameras())
      sources.push_back({i, &case_.rig.cameras[i], case_.image(i, number).view()});
    return sources;
  }

  const Case& case_;
  const bool sharpened_;
  std::vector<ByteBuffer> sharp_;
  const Mesh mesh_;
  std::vector<CameraIndex> own_;
};

// View `number` focused on a plane parallel to the array.
View on_plane(const Case& c, size_t number, const Plane& from, double distance) {
  View view = c.views[number].view;
  view.focus.plane = {from.normal, from.d - distance};
  return view;
}

double distance_of(const FocalMap& range, int k, int planes) {
  return 1 / range.inverse_of(FocalMap::kLevels * (k + 0.5) / planes);
}

FocalMap map_of(const DepthRange& range) {
  FocalMap map;
  map.farthest = range.farthest;
  map.nearest = range.nearest;
  return map;
}

int squared_error(const Image& a, const Image& b, size_t pixel) {
  int sum = 0;
  for (size_t i = 3 * pixel; i < 3 * pixel + 3; i++) sum += (a.data()[i] - b.data()[i]) * (a.data()[i] - b.data()[i]);
  return sum;
}

}  // namespace

StillResult measure_still(const Case& c, size_t view, const Options& options) {
  const Plane from = array_plane(c.rig);
  const Image truth = c.truth(view);
  const FocalMap range = map_of(options.range);
  StillResult result;
  Renderer bilinear(c, false), renderer(c, options.sharpened);
  for (int k = 0; k < options.planes; k++) {
    const double distance = distance_of(range, k, options.planes);
    Picture plane = bilinear.picture(on_plane(c, view, from, distance), view);
    plane.quality = compare(plane.image, truth, plane.coverage);
    if (k == 0) result.bound = plane;
    for (size_t i = 0; i < plane.coverage.size(); i++)
      if (squared_error(plane.image, truth, i) < squared_error(result.bound.image, truth, i))
        std::copy_n(plane.image.data().begin() + static_cast<ptrdiff_t>(3 * i), 3,
                    result.bound.image.data().begin() + static_cast<ptrdiff_t>(3 * i));
    if (k > 0 && plane.quality.psnr_db <= result.plane.quality.psnr_db) continue;
    result.plane = std::move(plane);
    result.best_distance = distance;
  }
  result.bound.quality = compare(result.bound.image, truth, result.bound.coverage);

  // The viewer has focused on the middle of the range.
  FocusControl control(options.focus);
  ViewRequest request;
  request.view = on_plane(c, view, from, distance_of(range, options.planes / 2, options.planes));
  for (int round = 0; round <= options.rounds; round++) {
    Picture picture = renderer.picture(request.view, view);
    picture.quality = compare(picture.image, truth, picture.coverage);
    const std::vector<Moments> moments = renderer.moments(request, view, picture);
    const uint64_t begun = now_ns();
    const FocusControl::Plan plan = control.next(request, moments, from);
    picture.trial_ms += milliseconds(now_ns() - begun);
    result.rounds.push_back(std::move(picture));
    request.view = plan.view;
    request.trials = plan.trials;
  }
  result.state = control.state();
  result.map = request.view.focus.map;
  return result;
}

std::vector<Frame> measure_film(const Case& c, const Options& options, const std::function<void()>& progress) {
  constexpr int kPlanes = 16;
  const Plane from = array_plane(c.rig);
  const FocalMap range = map_of(options.range);
  Renderer bilinear(c, false), renderer(c, options.sharpened);
  FocusControl control(options.focus);
  FocusControl::Plan plan;
  std::vector<Frame> frames(c.views.size());
  std::vector<std::vector<double>> plane_db(kPlanes, std::vector<double>(frames.size()));
  for (size_t i = 0; i < frames.size(); i++) {
    const Image truth = c.truth(i);
    const auto psnr = [&](const Picture& picture) { return compare(picture.image, truth, picture.coverage).psnr_db; };
    for (int k = 0; k < kPlanes; k++)
      plane_db[k][i] = psnr(bilinear.picture(on_plane(c, i, from, distance_of(range, k, kPlanes)), i));
    ViewRequest request;
    request.view = on_plane(c, i, from, distance_of(range, kPlanes / 2, kPlanes));
    if (plan.view.focus.map) {
      request.view.focus.map = carry_over(plan.view, request.view);
      request.trials = plan.trials;
    }
    Picture cost;
    frames[i].surface_db = psnr(renderer.picture(request.view, i));
    plan = control.next(request, renderer.moments(request, i, cost), from);
    progress();
  }
  const auto best = std::ranges::max_element(
      plane_db, {}, [](const std::vector<double>& db) { return std::accumulate(db.begin(), db.end(), 0.0); });
  for (size_t i = 0; i < frames.size(); i++) frames[i].plane_db = (*best)[i];
  return frames;
}

}  // namespace lf::focus
