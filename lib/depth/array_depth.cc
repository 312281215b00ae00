// SPDX-License-Identifier: LGPL-2.1-or-later
#include "depth/array_depth.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <span>

namespace lf {

namespace {

// Images are reduced by this factor, or more if a reduced image would have more than kMaxPixels pixels, or all of them
// together more than kMaxTotalPixels, of 16 bytes each.
constexpr int kDivisor = 2;
constexpr double kMaxPixels = 1 << 19, kMaxTotalPixels = 1 << 25;
// Planes are this far apart in the image of the median neighbour, in pixels of the reduced images.
constexpr double kPlaneDistance = 1;
constexpr int kMinPlanes = 12, kMaxPlanes = 128;
// The scene's range contains the confident depths between these percentiles.
constexpr double kLowest = 0.005, kHighest = 0.995;
constexpr float kConfident = 0.5f;

int divisor_of(const Rig& rig, const CameraSet& cameras) {
  double pixels = 0;
  for (const CameraIndex i : cameras)
    pixels = std::max(pixels, static_cast<double>(rig.cameras[i].width) * rig.cameras[i].height);
  const double limit = std::min(kMaxPixels, kMaxTotalPixels / static_cast<double>(cameras.size()));
  return std::max(kDivisor, static_cast<int>(std::ceil(std::sqrt(pixels / limit))));
}

// Returns the places in `images` of up to `count` cameras around one camera, the nearest first. Cameras in different
// directions are preferred, because a thing may be hidden from all cameras on one side.
std::vector<size_t> cameras_beside(std::span<const MatchingImage* const> images, size_t of, size_t count) {
  const Vec3 middle = images[of]->pose.position;
  const auto distance = [&](size_t i) { return glm::distance(images[i]->pose.position, middle); };
  std::vector<size_t> by_distance;
  for (size_t i = 0; i < images.size(); i++)
    if (i != of && distance(i) > 0) by_distance.push_back(i);
  std::ranges::stable_sort(by_distance, {}, distance);
  std::vector<size_t> chosen;
  for (const double max_cosine : {0.5, 0.85, 2.0})
    for (const size_t i : by_distance) {
      if (chosen.size() == count) return chosen;
      const Vec3 direction = glm::normalize(images[i]->pose.position - middle);
      const bool is_apart = std::ranges::all_of(chosen, [&](size_t other) {
        return glm::dot(direction, glm::normalize(images[other]->pose.position - middle)) <= max_cosine;
      });
      if (is_apart && std::ranges::find(chosen, i) == chosen.end()) chosen.push_back(i);
    }
  return chosen;
}

int planes_of(const MatchingImage& image, std::span<const MatchingImage* const> neighbours, const DepthSweep& range) {
  if (neighbours.empty()) return kMinPlanes;
  std::vector<double> baselines;
  for (const MatchingImage* other : neighbours)
    baselines.push_back(glm::distance(other->pose.position, image.pose.position));
  const double disparity = median(std::move(baselines)) * image.focal * (range.nearest - range.farthest);
  return static_cast<int>(std::clamp<double>(std::ceil(disparity / kPlaneDistance), kMinPlanes, kMaxPlanes));
}

}  // namespace

ArrayDepth::ArrayDepth(const Rig& rig, const CameraSet& cameras, const CameraImages& images, double farthest,
                       double nearest, const ParallelFor& parallel) {
  range_ = {.farthest = farthest, .nearest = nearest};
  const int divisor = divisor_of(rig, cameras);
  estimate(rig, cameras, images, 2 * divisor, parallel);
  range_ = confident_range();
  estimate(rig, cameras, images, divisor, parallel);
}

void ArrayDepth::estimate(const Rig& rig, const CameraSet& cameras, const CameraImages& images, int divisor,
                          const ParallelFor& parallel) {
  cameras_.clear();
  cameras_.resize(cameras.size());
  std::vector<const MatchingImage*> all;
  for (size_t i = 0; i < cameras.size(); i++) {
    cameras_[i].image = matching_image(rig.cameras[cameras[i]], images(cameras[i]).view(), divisor);
    all.push_back(&cameras_[i].image);
  }
  std::vector<std::vector<const MatchingImage*>> beside(cameras.size());
  for (size_t i = 0; i < cameras.size(); i++) {
    for (const size_t other : cameras_beside(all, i, kMatched)) beside[i].push_back(all[other]);
    range_.planes = std::max(range_.planes, planes_of(*all[i], beside[i], range_));
  }
  parallel(cameras_.size(),
           [&](size_t i) { cameras_[i].depth = estimate_depth(cameras_[i].image, beside[i], range_); });
  parallel(cameras_.size(), [&](size_t i) {
    std::vector<DepthNeighbour> neighbours;
    for (const size_t other : cameras_beside(all, i, kChecked))
      neighbours.push_back({&cameras_[other].image, &cameras_[other].depth});
    cameras_[i].depth.confidence = check_consistency(cameras_[i].image, cameras_[i].depth, neighbours, range_.step());
  });
}

DepthSweep ArrayDepth::confident_range() const {
  std::vector<float> depths;
  for (const Camera& camera : cameras_)
    for (size_t i = 0; i < camera.depth.inverse.size(); i++)
      if (camera.depth.confidence[i] >= kConfident) depths.push_back(camera.depth.inverse[i]);
  DepthSweep range = range_;
  range.planes = 0;
  if (depths.empty()) return range;
  const auto percentile = [&](double part) {
    const auto at = depths.begin() + static_cast<ptrdiff_t>(part * static_cast<double>(depths.size() - 1));
    std::nth_element(depths.begin(), at, depths.end());
    return static_cast<double>(*at);
  };
  range.farthest = std::max(range_.farthest, percentile(kLowest) - range_.step());
  range.nearest = std::min(range_.nearest, percentile(kHighest) + range_.step());
  return range;
}

std::vector<ArrayDepth::WeightedCamera> ArrayDepth::cameras_around(const Vec3& eye) const {
  std::vector<size_t> order(cameras_.size());
  std::iota(order.begin(), order.end(), 0);
  const auto distance = [&](size_t i) { return glm::distance(cameras_[i].image.pose.position, eye); };
  std::ranges::stable_sort(order, {}, distance);
  const size_t count = std::min<size_t>(kCameras, order.size());
  const double beyond = order.size() > count ? distance(order[count]) : 2 * distance(order[count - 1]);
  std::vector<WeightedCamera> chosen;
  for (size_t k = 0; k < count; k++) {
    const double share = beyond > 0 ? distance(order[k]) / beyond : 0;
    chosen.push_back({&cameras_[order[k]], static_cast<float>(std::sqrt((1 - share) / (share + 0.02)))});
  }
  return chosen;
}

float ArrayDepth::inverse_at(const std::vector<WeightedCamera>& cameras, const View& view, const Vec2& pixel) const {
  constexpr float kTolerance = 1.5f;  // steps
  constexpr float kLeastConfidence = 0.1f;
  // The first peak above kAccepted is taken, once the agreement has fallen to half of it.
  constexpr float kAccepted = 0.3f;
  constexpr int kPerStep = 2;
  const std::optional<Vec2> normalised = view.lens.unproject(pixel);
  if (!normalised) return static_cast<float>(range_.farthest);
  const Vec3 ray = view.pose.rotation() * Vec3(*normalised, 1);

  // The line of sight in each camera's image.
  struct Line {
    Vec3 far, parallax;
  };
  std::array<Line, kCameras> lines;
  for (size_t k = 0; k < cameras.size(); k++) {
    const MatchingImage& image = cameras[k].camera->image;
    const Mat3 to_camera = glm::transpose(image.pose.rotation());
    const auto project = [&](const Vec3& v) {
      return Vec3(image.focal * v.x + image.centre.x * v.z, image.focal * v.y + image.centre.y * v.z, v.z);
    };
    lines[k] = {project(to_camera * ray), project(to_camera * (view.pose.position - image.pose.position))};
  }

  const double step = range_.step() / kPerStep;
  float best = 0, best_inverse = static_cast<float>(range_.farthest);
  for (int i = kPerStep * (range_.planes - 1); i >= 0; i--) {
    const double inverse = range_.farthest + i * step;
    float agreeing = 0, seeing = 0, present = 0;
    for (size_t k = 0; k < cameras.size(); k++) {
      const auto& [camera, weight] = cameras[k];
      const MatchingImage& image = camera->image;
      const Vec3 at = lines[k].far + inverse * lines[k].parallax;
      if (!(at.z > 0)) continue;
      const double x = at.x / at.z + 0.5, y = at.y / at.z + 0.5;
      if (!(x >= 0 && y >= 0 && x < image.width && y < image.height)) continue;
      const size_t at_pixel = static_cast<size_t>(y) * image.width + static_cast<size_t>(x);
      const auto behind = static_cast<float>((inverse / at.z - camera->depth.inverse[at_pixel]) / range_.step());
      const float trust = weight * std::max(kLeastConfidence, camera->depth.confidence[at_pixel]);
      present += weight;
      agreeing += trust * std::max(0.f, 1 - std::abs(behind) / kTolerance);
      if (behind > -kTolerance) seeing += trust;
    }
    if (!(seeing > 0)) continue;
    // Agreement of a small part of the cameras is not reliable.
    const float agreement = agreeing / seeing * std::min(1.f, seeing / (0.1f * present));
    if (agreement > best) {
      best = agreement;
      best_inverse = static_cast<float>(inverse);
    }
    if (best > kAccepted && agreement < best / 2) break;
  }
  return best_inverse;
}

FocalMap ArrayDepth::surface(const View& view, const ParallelFor& parallel) const {
  FocalMap map = FocalMap::for_view(view.width, view.height);
  map.from = plane_through(view.pose.position, view.pose.rotation()[2]);
  const std::vector<WeightedCamera> cameras = cameras_around(view.pose.position);
  const double middle = (map.step - 1) / 2.0;
  std::vector<float> inverse(static_cast<size_t>(map.columns) * map.rows), smooth(inverse.size());
  parallel(static_cast<size_t>(map.rows), [&](size_t row) {
    for (int i = 0; i < map.columns; i++)
      inverse[row * map.columns + i] =
          inverse_at(cameras, view, {map.step * i + middle, map.step * static_cast<double>(row) + middle});
  });
  median_filter(inverse, map.columns, map.rows, smooth);

  const auto [least, largest] = std::ranges::minmax(smooth);
  map.farthest = least;
  map.nearest = std::max<double>(largest, least * 1.001 + 1e-6);
  map.levels.reserve(smooth.size());
  for (const float value : smooth) map.levels.push_back(map.level_of(value));
  return map;
}

}  // namespace lf
