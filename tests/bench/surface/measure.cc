// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/surface/measure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "base/maths.h"
#include "base/schedule.h"
#include "base/text.h"
#include "bench/sum_picture.h"
#include "focus/exposure_compensation.h"
#include "focus/focus_array.h"
#include "focus/hypothesis_renderer.h"
#include "focus/warp_depth_map.h"
#include "image/image_filters.h"
#include "node/request_renderer.h"
#include "render/camera_projection.h"
#include "render/contribution_map.h"
#include "render/ownership.h"
#include "render/sum_renderer.h"
#include "wire/consistency_codec.h"

namespace lf::focus {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr double kMinCover = 0.5;  // fraction of the maximum coverage over all planes

int squared_error(const Image& a, const Image& b, size_t pixel) {
  int sum = 0;
  for (size_t i = 3 * pixel; i < 3 * pixel + 3; i++) sum += (a.data()[i] - b.data()[i]) * (a.data()[i] - b.data()[i]);
  return sum;
}

// Sum of squared errors of the covered pixels, and their number.
struct Error2 {
  double sum = 0;
  size_t pixels = 0;
  void add(int squared) {
    sum += squared;
    pixels++;
  }
  double mean() const { return pixels > 0 ? sum / static_cast<double>(pixels) : kInfinite; }
};

Error2 error_of(const Picture& picture, const Image& truth) {
  Error2 error;
  for (size_t i = 0; i < picture.coverage.size(); i++)
    if (picture.coverage[i] > kMinCoverage) error.add(squared_error(picture.image, truth, i));
  return error;
}

// Returns the plane with the least mean error, among planes with enough coverage; nullopt if nothing is covered.
std::optional<size_t> best_of(std::span<const Error2> errors) {
  size_t most = 0;
  for (const Error2& error : errors) most = std::max(most, error.pixels);
  std::optional<size_t> best;
  for (size_t k = 0; k < errors.size(); k++) {
    if (errors[k].pixels == 0 || static_cast<double>(errors[k].pixels) < kMinCover * static_cast<double>(most))
      continue;
    if (!best || errors[k].mean() < errors[*best].mean()) best = k;
  }
  return best;
}

// Every nth pixel of a view and of its truth, as a smaller view: sufficient to judge planes.
struct Thinned {
  View view;
  Image truth;
};

Thinned thinned(const View& view, const Image& truth, int n) {
  const int first = n / 2;
  Thinned out{view, {}};
  out.view.width = (view.width - 1 - first) / n + 1;
  out.view.height = (view.height - 1 - first) / n + 1;
  std::array<double, Lens::kMaxParams> params = view.lens.params();
  const int focal = lens_model_num_focal(view.lens.model());
  for (int i = 0; i < focal; i++) params[i] /= n;
  for (int i = focal; i < focal + 2; i++) params[i] = (params[i] - first) / n;
  out.view.lens = Lens(view.lens.model(), params);
  out.truth = Image(PixelFamily::kRgb, out.view.width, out.view.height);
  for (int y = 0; y < out.view.height; y++)
    for (int x = 0; x < out.view.width; x++)
      std::copy_n(truth.pixel(first + n * x, first + n * y), 3, out.truth.pixel(x, y));
  return out;
}

double median_corner_distance(const Rig& rig, const Mesh& mesh) {
  std::vector<double> lengths;
  for (const MeshFace& face : mesh.faces)
    for (int i = 1; i < face.corners(); i++)
      for (int j = 0; j < i; j++)
        lengths.push_back(
            glm::length(rig.cameras[face.camera[i]].pose.position - rig.cameras[face.camera[j]].pose.position));
  if (lengths.empty()) return 0;
  const auto middle = lengths.begin() + static_cast<ptrdiff_t>(lengths.size() / 2);
  std::ranges::nth_element(lengths, middle);
  return *middle;
}

// Planes from far to near, with the mean error of each block of each picture; infinite if less than half of a block is
// covered.
class Survey {
 public:
  Survey(const Thinned& thin, const Plane& from, const Draw& draw) : thin_(thin), from_(from), draw_(draw) {}

  Error2 look(double inverse) { return error_of(drawn(inverse), thin_.truth); }

  // Returns false if too few pixels are covered to be useful.
  bool add(double inverse) {
    const Picture picture = drawn(inverse);
    errors.push_back(error_of(picture, thin_.truth));
    inverses.push_back(inverse);
    most_ = std::max(most_, errors.back().pixels);
    std::vector<float>& of_blocks = blocks_.emplace_back();
    for (int y = 0; y + kBlock <= thin_.view.height; y += kNext)
      for (int x = 0; x + kBlock <= thin_.view.width; x += kNext) of_blocks.push_back(block(picture, x, y));
    return static_cast<double>(errors.back().pixels) >= kMinCover * static_cast<double>(most_);
  }

  // Returns the plane in front of a fraction `part` of the blocks. A block's weight is the drop of its error at its
  // best plane: blocks without texture or without a distinct best plane have no weight.
  double inverse_at(double part) const {
    const double all = std::accumulate(evidence_.begin(), evidence_.end(), 0.0);
    size_t k = 0;
    for (double so_far = evidence_[0]; k + 1 < evidence_.size() && so_far <= part * all; so_far += evidence_[++k]) {
    }
    return inverses[k];
  }
  void weigh() {
    evidence_.assign(blocks_.size(), 0);
    for (size_t i = 0; i < blocks_[0].size(); i++) {
      std::vector<float> seen;
      size_t best = 0;
      for (size_t k = 0; k < blocks_.size(); k++) {
        if (blocks_[k][i] < kNotSeen) seen.push_back(blocks_[k][i]);
        if (blocks_[k][i] < blocks_[best][i]) best = k;
      }
      if (seen.empty()) continue;
      const double usual = std::sqrt(median(std::move(seen))), least = std::sqrt(blocks_[best][i]);
      if (least < kDistinct * usual) evidence_[best] += usual - least;
    }
  }

  std::vector<double> inverses;
  std::vector<Error2> errors;

 private:
  static constexpr int kBlock = 8;                  // pixels
  static constexpr int kNext = 4;                   // pixels from one block to the next
  static constexpr double kDistinct = 0.5;          // error of the best plane, relative to the median plane
  static constexpr float kNotSeen = 3 * 255 * 255;  // error of a block that no plane covers

  Picture drawn(double inverse) const { return draw_(on_plane(thin_.view, from_, 1 / inverse)); }

  float block(const Picture& picture, int x0, int y0) const {
    Error2 error;
    for (int y = y0; y < y0 + kBlock; y++)
      for (int x = x0; x < x0 + kBlock; x++) {
        const size_t i = static_cast<size_t>(y) * thin_.view.width + x;
        if (picture.coverage[i] > kMinCoverage) error.add(squared_error(picture.image, thin_.truth, i));
      }
    return 2 * error.pixels >= kBlock * kBlock ? static_cast<float>(error.mean()) : kNotSeen;
  }

  const Thinned& thin_;
  const Plane& from_;
  const Draw& draw_;
  size_t most_ = 0;
  std::vector<std::vector<float>> blocks_;  // per plane
  std::vector<double> evidence_;            // evidence of the scene, per plane
};

}  // namespace

View on_plane(const View& view, const Plane& from, double distance) {
  View out = view;
  out.focus.plane = {from.normal, from.d - distance};
  return out;
}

std::optional<Depths> find_depths(const Rig& rig, const Mesh& mesh, const View& view, const Image& truth,
                                  const Plane& from, const Draw& draw) {
  constexpr int kColumns = 160;       // approximate width of the thinned view
  constexpr double kFarthest = 0.25;  // pixels of disparity between neighbours
  constexpr double kApart = 0.5;      // for a view with 320 columns: textures of larger views are coarser as well
  constexpr double kFinest = 0.05;
  constexpr double kOutliers = 0.02;  // fraction of the evidence, on each side
  constexpr double kMargin = 0.05;    // fraction of the range, on each side
  const double edge = median_corner_distance(rig, mesh);
  if (!(edge > 0)) throw Error("all cameras are at one place: nothing is nearer or farther to them");
  const double pixel = 1 / (view.lens.fx() * edge);  // a pixel of disparity, as inverse distance

  const Thinned thin = thinned(view, truth, std::max(1, view.width / kColumns));
  Survey survey(thin, from, draw);
  const double apart = kApart * std::max(1.0, view.width / 320.0) * pixel;
  const auto apart_at = [&](double inverse) { return std::clamp(inverse / 8, pixel / 8, apart); };
  double inverse = kFarthest * pixel;
  while (survey.add(inverse) && inverse < view.width * pixel) inverse += apart_at(inverse);
  const std::optional<size_t> best = best_of(survey.errors);
  if (!best) return std::nullopt;

  double at = survey.inverses[*best], least = survey.errors[*best].mean();
  for (double step = apart_at(at) / 2; step > kFinest * pixel; step /= 2)
    for (const double tried : {at - step, at + step}) {
      if (!(tried > 0)) continue;
      const double error = survey.look(tried).mean();
      if (!(error < least)) continue;
      least = error;
      at = tried;
    }
  survey.weigh();
  const double farthest = survey.inverse_at(kOutliers), nearest = survey.inverse_at(1 - kOutliers);
  const double margin = std::max(kMargin * (nearest - farthest), apart_at(nearest));
  return Depths{.range = {std::max(farthest - margin, kFarthest * pixel), nearest + margin},
                .middle = survey.inverse_at(0.5),
                .best = at};
}

JudgedPlanes judge_planes(const View& view, const Image& truth, const Plane& from, std::span<const double> distances,
                          const Draw& draw) {
  JudgedPlanes judged;
  std::vector<Error2> errors;
  std::vector<int> least;
  for (const double distance : distances) {
    const Picture plane = draw(on_plane(view, from, distance));
    errors.push_back(error_of(plane, truth));
    if (least.empty()) {
      judged.bound = plane;
      least.assign(plane.coverage.size(), std::numeric_limits<int>::max());
    }
    for (size_t i = 0; i < least.size(); i++) {
      // Pixels may lack some of their cameras; the plane with the largest coverage determines whether they count.
      judged.bound.coverage[i] = std::max(judged.bound.coverage[i], plane.coverage[i]);
      if (!(plane.coverage[i] > 0)) continue;
      const int error = squared_error(plane.image, truth, i);
      if (error >= least[i]) continue;
      least[i] = error;
      std::copy_n(plane.image.data().begin() + static_cast<ptrdiff_t>(3 * i), 3,
                  judged.bound.image.data().begin() + static_cast<ptrdiff_t>(3 * i));
    }
  }
  judged.bound.quality = compare(judged.bound.image, truth, judged.bound.coverage);
  judged.best_distance = distances[best_of(errors).value_or(0)];
  judged.best = draw(on_plane(view, from, judged.best_distance));
  judged.best.quality = compare(judged.best.image, truth, judged.best.coverage);
  return judged;
}

namespace {

double milliseconds(uint64_t ns) { return static_cast<double>(ns) / 1e6; }

// Everything that a node and a compositor do for a view, in one thread without encoding.
class Renderer {
 public:
  // For view `number` of the case.
  Renderer(const Case& c, size_t number, const Options& options)
      : case_(c),
        resampling_(options.resampling),
        matched_(options.gains),
        mesh_(build_mesh(c.rig, c.without(number))) {
    for (CameraIndex i = 0; i < c.rig.cameras.size(); i++)
      if (!std::ranges::binary_search(c.without(number), i)) own_.push_back(i);
  }

  Picture picture(const View& view, size_t number, const GainRequest& gains = {}) {
    Picture out;
    const RenderJob job(case_.rig, mesh_, view, own_);
    std::vector<Source> sources = sources_of(job, number);
    const uint64_t begun = now_ns();
    if (matched_ && gains.use) sources = match(job, sources, matcher_.gains_for(gains));
    const bool sharpened = resampling_ == Resampling::kSharpened;
    sharp_.resize(sharpened ? std::max(sharp_.size(), sources.size()) : 0);
    for (size_t i = 0; sharpened && i < sources.size(); i++)
      sources[i].image =
          sharpen(sources[i].image, needed_pixels(job.plan(), sources[i].camera, *sources[i].rig_camera), sharp_[i]);
    const SumRenderer renderer(job.plan(), job.runs(), sources, PixelFamily::kRgb);
    auto [image, bytes] = bench::picture_of_sums(renderer, view.width, view.height);
    out.image = std::move(image);
    out.colour_ms = milliseconds(now_ns() - begun);
    out.colour_bytes = static_cast<double>(bytes);
    out.coverage = view_coverage(case_.rig, job.plan(), FaceIdMap(job.runs()));
    return out;
  }

  std::vector<PhotoConsistency> moments(const ViewRequest& request, size_t number, Picture& cost) {
    if (request.hypotheses.empty()) return {};
    const uint64_t begun = now_ns();
    const std::vector<std::vector<uint8_t>> levels = hypothesis_levels(request.view, request.hypotheses);
    std::vector<PhotoConsistency> sums(levels.size());
    for (PhotoConsistency& sum : sums) sum.reset(request.view.focus.map->columns, request.view.focus.map->rows);
    const RenderJob job(case_.rig, mesh_, hypothesis_view(request.view), own_);
    const uint64_t planned = now_ns();
    std::vector<Source> sources = sources_of(job, number);
    const uint64_t ready = now_ns();
    if (matched_ && request.gains.use) sources = match(job, sources, matcher_.gains_for(request.gains));
    add_consistency(job, sources, levels, sums);
    cost.depth_ms += milliseconds(now_ns() - ready + planned - begun);
    cost.consistency_bytes += static_cast<double>(wire::encode_consistency({}, sums).size());
    return sums;
  }

  // Call after the hypotheses: returns the brightness measurement for the next request. `mixed`: see
  // DepthEstimator::State.
  GainRequest gains_after(const ViewRequest& request, size_t number, bool mixed, Picture& cost) {
    GainRequest gains{.use = matched_ && mixed};
    if (!gains.use || !exposure_schedule_.next(!request.hypotheses.empty(), true)) return gains;
    gains.mean = mean(request, number, cost);
    gains.mean_of = request.sequence;
    return gains;
  }
  const Mesh& mesh() const { return mesh_; }
  const std::map<CameraIndex, BrightnessRatio>& gains() { return matcher_.gains_for({}).measured(); }

 private:
  std::vector<uint8_t> mean(const ViewRequest& request, size_t number, Picture& cost) {
    const uint64_t begun = now_ns();
    const WideLuma wide(case_.rig, mesh_, mean_view(request.view), own_);
    const uint64_t planned = now_ns();
    std::vector<Source> sources;
    for (const CameraIndex i : wide.cameras())
      sources.push_back({i, &case_.rig.cameras[i], case_.image(i, number).view()});
    const uint64_t ready = now_ns();
    WideLuma::Seen seen = wide.see(sources, matcher_.gains_for({}));
    std::vector<uint8_t> mean = mean_luma(seen.moments, seen.gains);
    matcher_.keep(request.sequence, std::move(seen.cameras));
    cost.depth_ms += milliseconds(now_ns() - ready + planned - begun);
    cost.consistency_bytes +=
        static_cast<double>(wire::encode_consistency({.gains = seen.gains}, {&seen.moments, 1}).size());
    return mean;
  }
  std::vector<Source> match(const RenderJob& job, const std::vector<Source>& sources,
                            const ExposureCompensation& gains) {
    const auto needed = [&](CameraIndex camera) {
      return needed_pixels(job.plan(), camera, case_.rig.cameras[camera]);
    };
    return GainMatcher::match(sources, gains, needed, divided_);
  }

  std::vector<Source> sources_of(const RenderJob& job, size_t number) const {
    std::vector<Source> sources;
    for (const CameraIndex i : job.cameras())
      sources.push_back({i, &case_.rig.cameras[i], case_.image(i, number).view()});
    return sources;
  }

  const Case& case_;
  const Resampling resampling_;
  const bool matched_;
  std::vector<ByteBuffer> divided_;
  GainMatcher matcher_;
  ExposureSchedule exposure_schedule_;
  std::vector<ByteBuffer> sharp_;
  const Mesh mesh_;
  std::vector<CameraIndex> own_;
};

void take(const DepthEstimator::Plan& plan, ViewRequest& request) {
  request.view = plan.view;
  request.hypotheses = plan.hypotheses;
  request.on_plane = plan.on_plane;
  if (plan.plane) request.view.focus.plane = *plan.plane;
}

View case_on_plane(const Case& c, size_t number, const Plane& from, double distance) {
  return lf::focus::on_plane(c.views[number].view, from, distance);
}

double distance_of(const FocalMap& range, int k, int planes) {
  return 1 / range.inverse_of(FocalMap::kLevels * (k + 0.5) / planes);
}

double start_of(const Options& options, const FocalMap& range, int planes) {
  return options.start > 0 ? options.start : distance_of(range, planes / 2, planes);
}

FocalMap map_of(const DepthRange& range) {
  FocalMap map;
  map.farthest = range.farthest;
  map.nearest = range.nearest;
  return map;
}

// Renders a picture a few more times; the least time counts.
void time_again(Renderer& renderer, const View& view, size_t number, const GainRequest& gains, Picture& picture) {
  constexpr int kTimes = 4;
  for (int i = 0; i < kTimes; i++)
    picture.colour_ms = std::min(picture.colour_ms, renderer.picture(view, number, gains).colour_ms);
}

// Returns the gain of a picture over the plane's, on the pixels that both cover.
double gain_alike(const Picture& plane, const Picture& picture, const Image& truth) {
  std::vector<float> both = plane.coverage;
  for (size_t i = 0; i < both.size(); i++) both[i] = std::min(both[i], picture.coverage[i]);
  return compare(picture.image, truth, both).psnr_db - compare(plane.image, truth, both).psnr_db;
}

// Returns the nodes with two separate, equally good planes.
std::vector<bool> unclear_nodes(Renderer& renderer, const View& view, size_t number) {
  constexpr int kPlanes = 32, kApart = 3;
  ViewRequest request;
  request.view = view;
  const size_t nodes = view.focus.map->levels.size();
  std::vector<std::vector<float>> cost(kPlanes);
  Picture ignored;
  for (int first = 0; first < kPlanes; first += kMaxHypotheses) {
    request.hypotheses.clear();
    for (int k = first; k < first + static_cast<int>(kMaxHypotheses); k++)
      request.hypotheses.push_back({DepthHypothesis::Kind::kPlane, static_cast<int16_t>(255 * k / (kPlanes - 1))});
    const std::vector<PhotoConsistency> moments = renderer.moments(request, number, ignored);
    for (size_t t = 0; t < moments.size(); t++)
      for (size_t i = 0; i < nodes; i++) cost[static_cast<size_t>(first) + t].push_back(moments[t].deviation(i));
  }
  std::vector<bool> unclear(nodes);
  for (size_t i = 0; i < nodes; i++) {
    int best = -1;
    for (int k = 0; k < kPlanes; k++)
      if (!std::isnan(cost[k][i]) && (best < 0 || cost[k][i] < cost[best][i])) best = k;
    if (best < 0) continue;
    const float as_good = 1.5f * cost[best][i] + 1, worse = 2 * as_good;
    for (const int step : {-1, 1}) {
      float ridge = 0;
      for (int k = best; k >= 0 && k < kPlanes; k += step) {
        ridge = std::max(ridge, cost[k][i]);
        if (std::abs(k - best) >= kApart && ridge > worse && cost[k][i] < as_good) unclear[i] = true;
      }
    }
  }
  return unclear;
}

double percentile(std::vector<double> values, double part) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<ptrdiff_t>(part * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, at);
  return *at;
}

}  // namespace

std::optional<Depths> find_depths(const Case& c, size_t view) {
  // Bilinear samples favour planes with few samples between pixels over planes in focus.
  Renderer sharpened(c, view, {.resampling = Resampling::kSharpened});
  return find_depths(c.rig, sharpened.mesh(), c.views[view].view, c.truth(view), array_plane(c.rig),
                     [&](const View& v) { return sharpened.picture(v, view); });
}

StillResult measure_still(const Case& c, size_t view, const Options& options) {
  const FocusArray array(c.rig);
  const Plane& from = array.from();
  const Image truth = c.truth(view);
  const FocalMap range = map_of(options.range);
  StillResult result;
  Renderer bilinear(c, view, {}), renderer(c, view, options);
  std::vector<double> distances;
  for (int k = 0; k < options.planes; k++) distances.push_back(distance_of(range, k, options.planes));
  if (options.one_more_plane > 0) distances.push_back(options.one_more_plane);
  JudgedPlanes judged = judge_planes(c.views[view].view, truth, from, distances,
                                     [&](const View& v) { return bilinear.picture(v, view); });
  result.plane = std::move(judged.best);
  result.bound = std::move(judged.bound);
  result.best_distance = judged.best_distance;
  const View best = case_on_plane(c, view, from, judged.best_distance);
  time_again(bilinear, best, view, {}, result.plane);
  result.plane_alike = renderer.picture(best, view);
  result.plane_alike.quality = compare(result.plane_alike.image, truth, result.plane_alike.coverage);
  time_again(renderer, best, view, {}, result.plane_alike);

  DepthEstimator control(options.focus);
  ViewRequest request;
  result.start = start_of(options, range, options.planes);
  request.view = case_on_plane(c, view, from, result.start);
  for (int round = 0; round <= options.rounds; round++) {
    request.sequence = static_cast<uint32_t>(round);
    request.out_of_service = c.without(view);
    Picture picture = renderer.picture(displayed_view(request), view, request.gains);
    picture.quality = compare(picture.image, truth, picture.coverage);
    if (round == options.rounds) time_again(renderer, displayed_view(request), view, request.gains, picture);
    const std::vector<PhotoConsistency> moments = renderer.moments(request, view, picture);
    request.gains = renderer.gains_after(request, view, control.state().mixed, picture);
    const uint64_t begun = now_ns();
    const DepthEstimator::Plan plan = control.next(request, moments, array);
    picture.depth_ms += milliseconds(now_ns() - begun);
    result.rounds.push_back(std::move(picture));
    take(plan, request);
  }
  if (options.gains) result.gains = renderer.gains();
  result.gain_alike_db = gain_alike(result.plane, result.rounds.back(), truth);
  result.state = control.state();
  result.map = request.view.focus.map;
  return result;
}

RestResult measure_rest(const Case& c, size_t view, const Options& options, int settle, int pictures) {
  const FocusArray array(c.rig);
  const Plane& from = array.from();
  Renderer renderer(c, view, options);
  DepthEstimator control(options.focus);
  ViewRequest request;
  request.view = case_on_plane(c, view, from, start_of(options, map_of(options.range), options.planes));
  const auto next = [&](Picture& cost) {
    const std::vector<PhotoConsistency> moments = renderer.moments(request, view, cost);
    request.gains = renderer.gains_after(request, view, control.state().mixed, cost);
    request.sequence++;
    take(control.next(request, moments, array), request);
  };
  Picture settling;
  for (int i = 0; i < settle; i++) next(settling);
  RestResult result;
  std::vector<double> sum, square;
  for (int i = 0; i < pictures; i++) {
    Picture picture = renderer.picture(displayed_view(request), view, request.gains);
    sum.resize(picture.image.data().size());
    square.resize(sum.size());
    for (size_t k = 0; k < sum.size(); k++) {
      const double v = picture.image.data()[k];
      sum[k] += v;
      square[k] += v * v;
    }
    next(picture);
    result.consistency_bytes += picture.consistency_bytes / pictures;
    result.colour_bytes = picture.colour_bytes;
    if (i + 1 == pictures) result.quality = compare(picture.image, c.truth(view), picture.coverage);
  }
  result.state = control.state();
  const FocalMap& map = *request.view.focus.map;
  const std::vector<bool> unclear = unclear_nodes(renderer, request.view, view);
  std::vector<double> deviations[2];
  for (int y = 0; y < request.view.height; y++)
    for (int x = 0; x < request.view.width; x++) {
      double largest = 0;
      for (size_t k = 0; k < 3; k++) {
        const size_t at = 3 * (static_cast<size_t>(y) * request.view.width + x) + k;
        const double mean = sum[at] / pictures;
        largest = std::max(largest, std::sqrt(std::max(square[at] / pictures - mean * mean, 0.0)));
      }
      deviations[unclear[static_cast<size_t>(y / map.step) * map.columns + x / map.step]].push_back(largest);
    }
  result.clear_median = percentile(deviations[0], 0.5);
  result.clear_p99 = percentile(deviations[0], 0.99);
  result.unclear_median = percentile(deviations[1], 0.5);
  result.unclear_p99 = percentile(deviations[1], 0.99);
  result.unclear = static_cast<double>(deviations[1].size()) / (request.view.width * request.view.height);
  return result;
}

std::vector<Frame> measure_film(const Case& c, const Options& options, const std::function<void()>& progress) {
  constexpr int kPlanes = 16;
  const FocusArray array(c.rig);
  const Plane& from = array.from();
  const FocalMap range = map_of(options.range);
  Renderer bilinear(c, 0, {}), renderer(c, 0, options);
  DepthEstimator control(options.focus);
  DepthEstimator::Plan plan;
  GainRequest gains;
  std::vector<Frame> frames(c.views.size());
  std::vector<std::vector<double>> plane_db(kPlanes, std::vector<double>(frames.size()));
  for (size_t i = 0; i < frames.size(); i++) {
    const Image truth = c.truth(i);
    const auto psnr = [&](const Picture& picture) { return compare(picture.image, truth, picture.coverage).psnr_db; };
    for (int k = 0; k < kPlanes; k++)
      plane_db[k][i] = psnr(bilinear.picture(case_on_plane(c, i, from, distance_of(range, k, kPlanes)), i));
    ViewRequest request;
    request.view = case_on_plane(c, i, from, start_of(options, range, kPlanes));
    if (plan.view.focus.map) {
      const View view = request.view;
      take(plan, request);
      request.view = view;
      request.view.focus.map = warp_depth_map(plan.view, view);
      if (plan.plane) request.view.focus.plane = *plan.plane;
    }
    request.gains = gains;
    request.sequence = static_cast<uint32_t>(i);
    Picture cost;
    frames[i].surface_db = psnr(renderer.picture(displayed_view(request), i, request.gains));
    plan = control.next(request, renderer.moments(request, i, cost), array);
    gains = renderer.gains_after(request, i, control.state().mixed, cost);
    progress();
  }
  const auto best = std::ranges::max_element(
      plane_db, {}, [](const std::vector<double>& db) { return std::accumulate(db.begin(), db.end(), 0.0); });
  for (size_t i = 0; i < frames.size(); i++) frames[i].plane_db = (*best)[i];
  return frames;
}

}  // namespace lf::focus
