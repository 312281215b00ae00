// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/still_focus.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numeric>
#include <utility>

#include "base/text.h"
#include "focus/depth_confidence.h"
#include "focus/hypothesis_levels.h"
#include "focus/hypothesis_renderer.h"
#include "focus/view_depths.h"
#include "image/image_filters.h"
#include "render/view_plan.h"

namespace lf {

namespace {

// Depth maps tell which cameras see a place, so that more cameras than the three of a triangle give a better picture.
constexpr Blending kBlendingOfDepths{Blending::Kind::kAngle, 0, ArrayDepth::kCameras};

// The images and gains of the cameras for one view of a static scene. Each image is fetched only once.
class StillArray {
 public:
  StillArray(const Rig& rig, const Mesh& mesh, const CameraImages& images, ExposureCompensation* gains)
      : rig_(rig), mesh_(mesh), images_(images), gains_(gains) {
    all_.resize(rig.cameras.size());
    std::iota(all_.begin(), all_.end(), 0);
  }

  // If the cameras have measured the view's surface, `depths` tell which cameras see it, for the first hypothesis; may
  // be null.
  std::vector<PhotoConsistency> moments(const ViewRequest& request, const ArrayDepth* depths = nullptr) {
    if (request.hypotheses.empty()) return {};
    const std::vector<std::vector<uint8_t>> levels = hypothesis_levels(request.view, request.hypotheses);
    std::vector<PhotoConsistency> sums(levels.size());
    for (PhotoConsistency& sum : sums) sum.reset(request.view.focus.map->columns, request.view.focus.map->rows);
    const RenderJob job(rig_, mesh_, hypothesis_view(request.view), all_);
    std::vector<Source> sources = sources_of(job.cameras());
    std::vector<ByteBuffer> divided(sources.size());
    std::vector<std::optional<VisibilityMask>> visibility(sources.size());
    for (size_t i = 0; i < sources.size() && depths; i++) {
      visibility[i] =
          depths->visibility(job.plan().view(), sources[i].camera, {{job.plan().camera_rect(sources[i].camera)}});
      if (visibility[i]) sources[i].visibility = &*visibility[i];
    }
    for (size_t i = 0; i < sources.size() && gains_ && request.gains.use; i++) {
      const float gain = gains_->of(sources[i].camera);
      if (std::abs(gain - 1) < kGainTolerance) continue;
      ImageView& image = sources[i].image;
      image = divide_by_gain(image, {0, 0, image.width, image.height}, gain, divided[i]);
    }
    add_consistency(job, sources, levels, sums);
    return sums;
  }

  // Returns how well the cameras agree about the surface of a view with a map: see PhotoConsistency.
  PhotoConsistency agreement(const View& view, const ArrayDepth* depths = nullptr) {
    ViewRequest request{.view = view, .hypotheses = {{DepthHypothesis::Kind::kBlurred, 0}}};
    return std::move(moments(request, depths).front());
  }

  // Updates the gains from the mean in the request, and computes the next mean if requested.
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

// Returns the mean squared deviations of two sums, over the nodes where both have a deviation and the same cameras.
// This excludes nodes that something hides from some cameras, because fewer cameras always agree better. Returns NaN if
// there are no such nodes.
std::pair<double, double> squared_deviations(const PhotoConsistency& a, const PhotoConsistency& b) {
  constexpr int kMissingWeight = PhotoConsistency::kWeightOne / 16;
  double sum_a = 0, sum_b = 0;
  size_t count = 0;
  for (size_t i = 0; i < a.weight.size(); i++) {
    if (std::abs(a.weight[i] - b.weight[i]) > kMissingWeight) continue;
    const double of_a = a.deviation(i), of_b = b.deviation(i);
    if (std::isnan(of_a) || std::isnan(of_b)) continue;
    sum_a += of_a * of_a;
    sum_b += of_b * of_b;
    count++;
  }
  return {sum_a / static_cast<double>(count), sum_b / static_cast<double>(count)};
}

// Returns the confidence of the surface of `measured`, compared with the map of `plane`. `sums` are the sums of both.
std::shared_ptr<const FocalMap> confidence_of(const View& measured, const View& plane,
                                              std::span<const PhotoConsistency> sums, const FocusArray& array) {
  const FocalMap &map = *measured.focus.map, &of_plane = *plane.focus.map;
  std::vector<uint8_t> levels[] = {map.levels, of_plane.levels};
  for (uint8_t& level : levels[1]) level = map.level_of(of_plane.inverse_of(level));
  const std::vector<std::vector<float>> costs = hypothesis_costs(sums, 1);
  const std::vector<float> evidence = array.evidence(measured, {});
  DepthConfidence confidence;
  confidence.add({map, levels, costs, evidence, array.levels_a_pixel(map)});
  return confidence.map();
}

bool can_read(const CameraImages& images, CameraIndex camera) {
  try {
    images(camera);
    return true;
  } catch (const Error&) {
    return false;
  }
}

// Returns the cameras (ascending) that need depth maps: the cameras around the eyes, and all contributing cameras.
CameraSet cameras_of(const Rig& rig, const Mesh& mesh, std::span<const View> views) {
  constexpr size_t kAround = 2 * ArrayDepth::kCameras;
  CameraSet all(rig.cameras.size());
  std::iota(all.begin(), all.end(), 0);
  CameraSet chosen;
  for (View view : views) {
    std::ranges::stable_sort(
        all, {}, [&](CameraIndex i) { return glm::distance(rig.cameras[i].pose.position, view.pose.position); });
    chosen.insert(chosen.end(), all.begin(), all.begin() + static_cast<ptrdiff_t>(std::min(kAround, all.size())));
    if (view.blending.is_mesh()) view.blending = kBlendingOfDepths;
    const CameraSet contributing = ViewPlan(rig, mesh, view).contributors();
    chosen.insert(chosen.end(), contributing.begin(), contributing.end());
  }
  std::ranges::sort(chosen);
  const auto [first, last] = std::ranges::unique(chosen);
  chosen.erase(first, last);
  return chosen;
}

}  // namespace

std::optional<ArrayDepth> estimate_depths(const Rig& rig, const CameraSet& cameras, std::span<const View> views,
                                          const CameraImages& images, const DepthEstimator::Settings& settings,
                                          const ParallelFor& parallel) {
  if (settings.mode == FocusMode::kPlane || cameras.size() < 2) return {};
  const Rig used = rig_subset(rig, cameras);
  const Mesh mesh = build_mesh(used);
  const FocusArray array(used, &mesh);
  const double nearest = settings.near > 0 ? 1 / settings.near : kNearestDepth * array.nearest();
  const double farthest = settings.far > 0 ? 1 / settings.far : 0;
  if (!(nearest > farthest)) return {};
  CameraSet readable;
  for (const CameraIndex i : cameras_of(used, mesh, views))
    if (can_read(images, cameras[i])) readable.push_back(cameras[i]);
  if (readable.size() < 2) return {};
  return ArrayDepth(
      rig, readable, [&](CameraIndex i) { return images(i).view(); }, farthest, nearest, parallel);
}

View focus_still(const Rig& rig, const Mesh& mesh, const View& view, const CameraImages& images,
                 const DepthEstimator::Settings& settings, int rounds, ExposureCompensation* gains,
                 const ArrayDepth* depths, std::shared_ptr<const FocalMap>* confidence) {
  const FocusArray array(rig, &mesh);
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
  View found = displayed_view(next_request());
  if (confidence) *confidence = focus.confidence();
  if (!depths) return found;
  View measured = found, plane = view;
  measured.focus.map = std::make_shared<const FocalMap>(depths->surface(view));
  plane.focus.map = std::make_shared<const FocalMap>(
      plane_map(view, measured.focus.map->from, depths->range().nearest, depths->range().farthest));
  const PhotoConsistency sums[] = {still.agreement(measured, depths), still.agreement(plane)};
  const auto [of_measured, of_plane] = squared_deviations(sums[0], sums[1]);
  if (!(of_measured < DepthEstimator::kMeasuredShown * of_plane)) return found;
  if (confidence) *confidence = confidence_of(measured, plane, sums, array);
  if (view.blending.is_mesh()) measured.blending = kBlendingOfDepths;
  return measured;
}

}  // namespace lf
