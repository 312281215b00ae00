// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/exposure_compensation.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <set>

#include "focus/focus_array.h"
#include "focus/hypothesis_levels.h"
#include "focus/hypothesis_renderer.h"
#include "focus/hypothesis_samples.h"
#include "image/image.h"
#include "image/image_filters.h"

namespace lf {

// Returns the probability that the camera has the right exposure. The measured ratio is normally distributed for such a
// camera (reflections and errors). For a camera with another exposure, it is uniform over the possible range of gains.
float ExposureCompensation::usual(CameraIndex camera) const {
  const auto found = measured_.find(camera);
  if (found == measured_.end()) return 1;
  const auto [x, error] = found->second;
  const float variance = kShine * kShine + error * error;
  const float even = 1 / std::log(kMost / kLeast);
  const float normal = std::exp(-x * x / (2 * variance)) / std::sqrt(2 * std::numbers::pi_v<float> * variance);
  return kUsual * normal / (kUsual * normal + (1 - kUsual) * even);
}

float ExposureCompensation::trust(CameraIndex camera) const {
  const auto found = measured_.find(camera);
  if (found == measured_.end()) return kUnknownTrust;
  const float off = found->second.log / kAround;
  return std::exp(-off * off / 2);
}

float ExposureCompensation::likely(CameraIndex camera) const {
  const auto found = measured_.find(camera);
  return found == measured_.end() ? 1 : std::exp((1 - usual(camera)) * found->second.log);
}

void ExposureCompensation::take(const std::map<CameraIndex, BrightnessRatio>& ratios) {
  if (ratios.empty()) return;
  for (const auto& [camera, ratio] : ratios)
    measured_[camera] = {std::clamp(ratio.log + std::log(likely(camera)), std::log(kLeast), std::log(kMost)),
                         ratio.error};
  means_ = std::min(means_ + 1, kMeans);
}

namespace {

constexpr int kMinWeight = static_cast<int>(PhotoConsistency::kWeightOne * ExposureCompensation::kUnknownTrust / 6);
constexpr float kDarkest = 16, kBrightest = 240;             // luma
constexpr float kMaxDeviation = 0.25f, kMaxChange = 0.5f;    // part of the mean

}  // namespace

void GainSum::add(float gain, float camera_weight) {
  weight += static_cast<uint32_t>(std::lround(camera_weight * kWeightOne));
  log2 += static_cast<int32_t>(std::lround(camera_weight * kWeightOne * std::log2(gain) * kOctave));
}

void GainSum::add(const GainSum& other) {
  weight += other.weight;
  log2 += other.log2;
}

float GainSum::mean() const {
  return weight == 0 ? 1 : std::exp2(static_cast<float>(log2) / static_cast<float>(weight) / kOctave);
}

std::vector<uint8_t> mean_luma(const PhotoConsistency& moments, const GainSum& gains) {
  const int columns = moments.columns, rows = moments.rows;
  const float scale = gains.mean();
  std::vector<float> mean(moments.weight.size());
  for (size_t i = 0; i < mean.size(); i++) {
    if (moments.weight[i] < kMinWeight) continue;
    const float weight = static_cast<float>(moments.weight[i]) / PhotoConsistency::kWeightOne;
    const float value = static_cast<float>(moments.luma[i]) / PhotoConsistency::kLumaOne / weight;
    const float variance = static_cast<float>(moments.square[i]) / weight - value * value;
    if (variance <= kMaxDeviation * kMaxDeviation * value * value) mean[i] = scale * value;
  }
  std::vector<uint8_t> levels(mean.size());
  for (int y = 1; y + 1 < rows; y++)
    for (int x = 1; x + 1 < columns; x++) {
      const size_t i = static_cast<size_t>(y) * columns + x;
      const auto around = {mean[i - 1], mean[i], mean[i + 1], mean[i - columns], mean[i + columns]};
      if (!(mean[i] >= kDarkest && mean[i] <= kBrightest)) continue;
      if (std::max(around) - std::min(around) > kMaxChange * mean[i]) continue;
      levels[i] = static_cast<uint8_t>(std::lround(mean[i]));
    }
  return levels;
}

namespace {

constexpr size_t kMinNodes = 24;
// A camera is compared with the mean only at nodes with a line of sight that crosses the array within 1.25 mesh edges
// of the camera. At other nodes, the mean comes from cameras on one side only. Reflections change along an array, in
// one scene by 2 % per camera, so the ratio would contain this change.
constexpr double kNear = 1.25;                            // edges
constexpr float kNearWeight = WideLuma::kPeak * 0.4578f;  // weight at this distance
// In a row of cameras, only two cameras are this near to a viewpoint between cameras. All cameras with a weight are
// then compared. The standard deviation of reflections is larger, because they may change as much as over one and a
// half cameras.
constexpr float kShineFromAfar = 0.03f;
// Nodes are not independent samples, because a whole object is either in focus or not. All nodes together count as this
// number of samples.
constexpr float kThings = 4;
constexpr float kRounded = 0.4f;                       // standard deviation of a quotient of rounded luma, levels
constexpr int kDarkestSeen = 8, kBrightestSeen = 250;  // luma

}  // namespace

View mean_view(const View& view) {
  const FocalMap& map = *view.focus.map;
  const std::vector<uint8_t> smooth = hypothesis_levels(map, {DepthHypothesis::Kind::kBlurred, 0});
  auto coarse = std::make_shared<FocalMap>(map);
  coarse->step = 2 * map.step;
  coarse->columns = FocalMap::nodes(map.columns, 2);
  coarse->rows = FocalMap::nodes(map.rows, 2);
  coarse->levels.clear();
  for (int y = 0; y < coarse->rows; y++)
    for (int x = 0; x < coarse->columns; x++) {
      const auto at = [&](int i, int j) {
        return smooth[static_cast<size_t>(std::min(j, map.rows - 1)) * map.columns + std::min(i, map.columns - 1)];
      };
      const int sum = at(2 * x, 2 * y) + at(2 * x + 1, 2 * y) + at(2 * x, 2 * y + 1) + at(2 * x + 1, 2 * y + 1);
      coarse->levels.push_back(static_cast<uint8_t>((sum + 2) / 4));
    }
  View wide = view;
  wide.focus.map = std::move(coarse);
  wide.blending = {};  // WideLuma has its own weights
  return hypothesis_view(wide);
}

WideLuma::WideLuma(const Rig& rig, const Mesh& mesh, const View& view, std::span<const CameraIndex> own)
    : plan_(rig, mesh, view) {
  const Plane& plane = view.focus.map->from;
  const double edge = median_edge(rig, mesh), pitch = edge > 0 ? edge : 1;
  const Vec3 aside = std::abs(plane.normal.x) < 0.8 ? Vec3(1, 0, 0) : Vec3(0, 1, 0);
  across_ = glm::normalize(glm::cross(plane.normal, aside)) / pitch;
  down_ = glm::cross(plane.normal, across_);
  const auto on_plane = [&](const Vec3& x) { return Vec2(glm::dot(across_, x), glm::dot(down_, x)); };
  const double height = plane.signed_distance(view.pose.position);
  const Mat3 world_from_view = view.pose.rotation();
  Vec2 low(INFINITY), high(-INFINITY);
  for (int y = 0; y < view.height; y++)
    for (int x = 0; x < view.width; x++) {
      const Vec2 ray = plan_.rays().at(x, y);
      u_.push_back(static_cast<float>(ray.x));
      v_.push_back(static_cast<float>(ray.y));
      const Vec3 d = world_from_view * Vec3(ray, 1);
      const double along = glm::dot(plane.normal, d);
      const Vec2 crossing = on_plane(view.pose.position - height / along * d);
      const bool crosses = along > 0 && std::isfinite(crossing.x + crossing.y);
      crossings_.push_back(crosses ? crossing : Vec2(std::numeric_limits<double>::max()));
      if (!crosses) continue;
      low = glm::min(low, crossing);
      high = glm::max(high, crossing);
    }
  for (std::vector<float>* of_rays : {&u_, &v_}) of_rays->resize(of_rays->size() + kHypothesisPadding);
  levels_.resize(u_.size());
  std::ranges::copy(view.focus.map->levels, levels_.begin());
  const auto is_within = [&](CameraIndex camera, double edges) {
    const Vec2 at = on_plane(rig.cameras[camera].pose.position);
    return glm::all(glm::greaterThan(at, low - edges)) && glm::all(glm::lessThan(at, high + edges));
  };
  std::ranges::copy_if(own, std::back_inserter(cameras_),
                       [&](CameraIndex camera) { return is_within(camera, kWidest); });
  const auto decide_within = [&](double edges) {
    std::set<CameraIndex> compared;
    for (const MeshFace& face : mesh.faces)
      for (int k = 0; k < face.corners(); k++)
        if (is_within(face.camera[k], edges)) compared.insert(face.camera[k]);
    return compared.size() > 2;
  };
  is_from_afar_ = !decide_within(kNear) && decide_within(kWidest);
  most_decide_ = is_from_afar_ || decide_within(kNear);
  if (!most_decide_ && decide_within(INFINITY)) cameras_.clear();
}

WideLuma::Camera WideLuma::see(const Source& source, float gain) const {
  const lf::Camera& camera = *source.rig_camera;
  check_image(camera, source.image);
  FetchBuffers memory;
  const ImageView image = fetched(source.image, {0, 0, camera.width, camera.height}, memory);
  HypothesisProjection projection = hypothesis_projection(plan_, source.camera, camera);
  projection.box = hypothesis_box(plan_, source.camera, camera);
  const Vec2 at(glm::dot(across_, camera.pose.position), glm::dot(down_, camera.pose.position));
  const size_t nodes = crossings_.size();
  WideLuma::Camera out{source.camera, std::vector<uint8_t>(nodes), std::vector<float>(nodes), is_from_afar_};
  if (image.family == PixelFamily::kNone) return out;
  const HypothesisValues values =
      sample_hypotheses(projection, {u_.data(), v_.data(), static_cast<int>(nodes)}, levels_, image);
  for (size_t i = 0; i < nodes; i++) {
    const Vec2 d = crossings_[i] - at;
    const auto squared = static_cast<float>(glm::dot(d, d));
    if (values[i] < 0 || !(squared < kWidest * kWidest)) continue;
    out.weight[i] = kPeak * std::exp(-squared / 2);
    out.luma[i] = static_cast<uint8_t>(values[i]);
  }
  divide_by_gain(out.luma, gain);
  return out;
}

WideLuma::Seen WideLuma::see(std::span<const Source> sources, const ExposureCompensation& gains,
                             const ParallelFor& parallel) const {
  Seen result;
  result.moments.reset(plan_.view().width, plan_.view().height);
  std::vector<const Source*> seeing;
  for (const Source& source : sources)
    if (source.image.family != PixelFamily::kNone && std::ranges::binary_search(cameras_, source.camera))
      seeing.push_back(&source);
  result.cameras.resize(seeing.size());
  parallel(seeing.size(), [&](size_t i) { result.cameras[i] = see(*seeing[i], gains.likely(seeing[i]->camera)); });
  const auto add = [](uint16_t& sum, float value) {
    sum = static_cast<uint16_t>(std::min(sum + static_cast<int>(value + 0.5f), 65535));
  };
  for (const Camera& camera : result.cameras) {
    const float total = std::accumulate(camera.weight.begin(), camera.weight.end(), 0.f);
    const float trust = most_decide_ ? gains.trust(camera.camera) : 1;
    result.gains.add(gains.likely(camera.camera), trust * total / static_cast<float>(camera.weight.size()));
    for (size_t i = 0; i < camera.weight.size(); i++) {
      const float weight = trust * camera.weight[i];
      if (weight == 0) continue;
      const auto luma = static_cast<float>(camera.luma[i]);
      add(result.moments.weight[i], weight * PhotoConsistency::kWeightOne);
      add(result.moments.luma[i], weight * luma * PhotoConsistency::kLumaOne);
      add(result.moments.square[i], weight * luma * luma);
    }
  }
  return result;
}

std::map<CameraIndex, BrightnessRatio> WideLuma::ratios(std::span<const Camera> seen, std::span<const uint8_t> mean) {
  std::map<CameraIndex, BrightnessRatio> ratios;
  for (const Camera& camera : seen)
    if (const std::optional<BrightnessRatio> one = ratio(camera, mean)) ratios[camera.camera] = *one;
  return ratios;
}

std::optional<BrightnessRatio> WideLuma::ratio(const Camera& seen, std::span<const uint8_t> mean) {
  if (mean.size() != seen.luma.size()) return std::nullopt;
  const float least = seen.is_from_afar ? 0 : kNearWeight, shine = seen.is_from_afar ? kShineFromAfar : 0;
  std::vector<float> ratios;
  float dark = 0;  // change of the log ratio for an error of one luma level, summed over the nodes
  for (size_t i = 0; i < mean.size(); i++)
    if (mean[i] != 0 && seen.weight[i] > least && seen.luma[i] >= kDarkestSeen && seen.luma[i] <= kBrightestSeen) {
      ratios.push_back(std::log(static_cast<float>(seen.luma[i]) / static_cast<float>(mean[i])));
      dark += 1 / static_cast<float>(mean[i]);
    }
  if (ratios.size() < kMinNodes) return std::nullopt;
  std::ranges::sort(ratios);
  const size_t n = ratios.size();
  const float deviation = (ratios[3 * n / 4] - ratios[n / 4]) / 1.35f;  // normal distribution with these quartiles
  const float differs = deviation / std::sqrt(kThings), rounded = kRounded * dark / static_cast<float>(n);
  return BrightnessRatio{ratios[n / 2], std::hypot(differs, rounded, shine)};
}

}  // namespace lf
