// SPDX-License-Identifier: LGPL-2.1-or-later
#include "depth/array_depth.h"

#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <utility>

namespace lf {

namespace {

// Images are reduced by this factor, or more if a reduced image would have more than kMaxPixels pixels, or all of them
// together more than kMaxTotalPixels, of 16 bytes each.
constexpr int kDivisor = 2;
constexpr double kMaxPixels = 1 << 19, kMaxTotalPixels = 1 << 25;
// Still images of at most this many pixels are matched at full resolution in the end.
constexpr double kMaxFullPixels = 1 << 18;
// Planes are this far apart in the image of the median neighbour, in pixels of the reduced images.
constexpr double kPlaneDistance = 1;
constexpr int kMinPlanes = 12, kMaxPlanes = 128;
// The scene's range contains the confident depths between these percentiles.
constexpr double kLowest = 0.005, kHighest = 0.995;
constexpr float kConfident = 0.5f;
// Number of updates that together test all planes, after which the depths of an unchanged image stay.
constexpr int kUpdates = 4;
// Depths that start with coarser ones test one in this number of planes.
constexpr int kSparsePlanes = 2;
// The first depths are coarser than the last by a factor of 2, or 4 if the images are then still this wide, in pixels.
constexpr int kMinCoarseWidth = 80;

// Returns the depths of an image for the pixels of a larger image of the same camera.
std::vector<float> enlarged(const MatchingImage& image, const std::vector<float>& inverse,
                            const MatchingImage& larger) {
  std::vector<float> out(larger.size());
  for (int y = 0; y < larger.height; y++)
    for (int x = 0; x < larger.width; x++) {
      const int column = std::min(x * image.width / larger.width, image.width - 1);
      const int row = std::min(y * image.height / larger.height, image.height - 1);
      out[static_cast<size_t>(y) * larger.width + x] = inverse[static_cast<size_t>(row) * image.width + column];
    }
  return out;
}

// Returns true if more than a small part of the pixels differs by more than noise.
bool differs(const MatchingImage& a, const MatchingImage& b) {
  constexpr int kNoise = 12 * MatchingImage::kUnit;
  constexpr double kPart = 0.005;
  if (a.size() != b.size()) return true;
  size_t different = 0;
  for (size_t i = 0; i < a.size(); i++) different += std::abs(a.pixels[i][0] - b.pixels[i][0]) > kNoise;
  return static_cast<double>(different) > kPart * static_cast<double>(a.size());
}

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

ArrayDepth::ArrayDepth(const Rig& rig, const CameraSet& cameras, const MatchedImages& images, double farthest,
                       double nearest, const ParallelFor& parallel) {
  *this = coarse(rig, cameras, images, farthest, nearest, parallel);
  while (!is_finest(rig)) *this = finer(rig, images, parallel);
  // The edges of small images are worth the time of their full resolution.
  double pixels = 0;
  for (const CameraIndex i : cameras)
    pixels = std::max(pixels, static_cast<double>(rig.cameras[i].width) * rig.cameras[i].height);
  if (divisor_ == kDivisor && pixels <= kMaxFullPixels) *this = finer(rig, images, parallel);
}

ArrayDepth ArrayDepth::coarse(const Rig& rig, const CameraSet& cameras, const MatchedImages& images, double farthest,
                              double nearest, const ParallelFor& parallel) {
  ArrayDepth depth;
  depth.range_ = {.farthest = farthest, .nearest = nearest};
  const int divisor = divisor_of(rig, cameras);
  int width = 0;
  for (const CameraIndex camera : cameras) width = std::max(width, rig.cameras[camera].width);
  const int factor = width / (4 * divisor) >= kMinCoarseWidth ? 4 : 2;
  depth.estimate(rig, cameras, {}, images, factor * divisor, {}, parallel);
  depth.range_ = depth.confident_range();
  return depth;
}

bool ArrayDepth::is_finest(const Rig& rig) const { return divisor_ <= divisor_of(rig, cameras()); }

ArrayDepth ArrayDepth::finer(const Rig& rig, const MatchedImages& images, const ParallelFor& parallel) const {
  ArrayDepth depth;
  depth.range_ = {.farthest = range_.farthest, .nearest = range_.nearest};
  depth.estimate(rig, cameras(), {}, images, divisor_ / 2, {.before = this, .first = cameras()}, parallel);
  return depth;
}

ArrayDepth ArrayDepth::quick_finer(const Rig& rig, const CameraSet& first, const MatchedImages& images,
                                   const ParallelFor& parallel) const {
  ArrayDepth depth;
  depth.range_ = {.farthest = range_.farthest, .nearest = range_.nearest};
  depth.estimate(rig, cameras(), {}, images, divisor_ / 2, {.before = this, .first = first, .is_quick = true},
                 parallel);
  return depth;
}

ArrayDepth ArrayDepth::updated(const Rig& rig, const CameraSet& cameras, const CameraSet& unchanged,
                               const MatchedImages& images, const ParallelFor& parallel) const {
  ArrayDepth depth;
  depth.range_ = range_;
  CameraSet incomplete;
  for (const auto& camera : cameras_)
    if (camera->is_incomplete && incomplete.size() < kCompleted) incomplete.push_back(camera->index);
  depth.estimate(rig, cameras, unchanged, images, divisor_, {.before = this, .first = incomplete}, parallel);
  return depth;
}

CameraSet ArrayDepth::cameras() const {
  CameraSet indices;
  for (const auto& camera : cameras_) indices.push_back(camera->index);
  return indices;
}

bool ArrayDepth::is_complete() const {
  return std::ranges::none_of(cameras_, [](const auto& camera) { return camera->is_incomplete; });
}

void ArrayDepth::estimate(const Rig& rig, const CameraSet& cameras, const CameraSet& unchanged,
                          const MatchedImages& images, int divisor, const Start& start, const ParallelFor& parallel) {
  divisor_ = divisor;
  const ArrayDepth* const before = start.before;
  const size_t count = cameras.size();
  std::vector<std::shared_ptr<Camera>> estimated(count);
  std::vector<std::shared_ptr<const Camera>> known(count);  // the cameras before, or null
  std::vector<const MatchingImage*> all(count);
  std::vector<char> is_new(count);
  for (size_t i = 0; i < count; i++) {
    if (before) {
      const auto found =
          std::ranges::find(before->cameras_, cameras[i], [](const auto& camera) { return camera->index; });
      if (found != before->cameras_.end()) known[i] = *found;
    }
    if (known[i] && std::ranges::binary_search(unchanged, cameras[i])) {
      all[i] = &known[i]->image;
      continue;
    }
    estimated[i] = std::make_shared<Camera>();
    estimated[i]->index = cameras[i];
    estimated[i]->image = matching_image(rig.cameras[cameras[i]], images(cameras[i]), divisor);
    all[i] = &estimated[i]->image;
    is_new[i] = !known[i] || differs(known[i]->image, *all[i]);
  }
  std::vector<std::vector<size_t>> beside(count);
  for (size_t i = 0; i < count; i++) beside[i] = cameras_beside(all, i, std::max(kMatched, kChecked));
  const auto images_beside = [&](size_t i) {
    std::vector<const MatchingImage*> neighbours;
    for (const size_t other : std::span(beside[i]).first(std::min<size_t>(kMatched, beside[i].size())))
      neighbours.push_back(all[other]);
    return neighbours;
  };
  if (range_.planes == 0)
    for (size_t i = 0; i < count; i++)
      range_.planes = std::max(range_.planes, planes_of(*all[i], images_beside(i), range_));
  const bool is_near = start.is_quick && divisor <= divisor_of(rig, cameras);
  parallel(count, [&](size_t i) {
    const bool is_stale = is_new[i] || std::ranges::any_of(beside[i], [&](size_t other) { return is_new[other]; });
    const bool is_first = std::ranges::binary_search(start.first, cameras[i]);
    const bool is_finer = known[i] && before->divisor_ != divisor;
    const bool is_coarse = is_finer || (!is_stale && known[i]->is_incomplete);
    const int rounds = is_stale ? kUpdates : known[i]->unsettled;
    if (is_coarse ? !is_first && !is_finer : rounds == 0) return;
    if (!estimated[i]) estimated[i] = std::make_shared<Camera>(*known[i]);
    Camera& camera = *estimated[i];
    camera.is_incomplete = is_coarse && (start.is_quick || !is_first);
    if (!known[i]) {
      camera.depth = estimate_depth(camera.image, images_beside(i), range_);
    } else if (!is_coarse) {
      camera.unsettled = rounds - 1;
      camera.depth =
          update_depth(camera.image, images_beside(i), range_, known[i]->depth.inverse, kUpdates, rounds % kUpdates);
    } else {
      std::vector<float> coarse =
          is_finer ? enlarged(known[i]->image, known[i]->depth.inverse, camera.image) : known[i]->depth.inverse;
      if (!is_first)
        camera.depth.inverse = std::move(coarse);
      else if (is_near)
        camera.depth = refine_depth(camera.image, images_beside(i), range_, coarse);
      else
        camera.depth = update_depth(camera.image, images_beside(i), range_, coarse, kSparsePlanes, 0);
    }
  });
  for (size_t i = 0; i < count; i++)
    cameras_.push_back(estimated[i] && !estimated[i]->depth.inverse.empty() ? estimated[i] : known[i]);
  parallel(count, [&](size_t i) {
    if (cameras_[i] == known[i]) return;
    std::vector<DepthNeighbour> neighbours;
    for (const size_t other : std::span(beside[i]).first(std::min<size_t>(kChecked, beside[i].size())))
      neighbours.push_back({&cameras_[other]->image, &cameras_[other]->depth});
    estimated[i]->depth.confidence =
        check_consistency(estimated[i]->image, estimated[i]->depth, neighbours, range_.step());
  });
}

DepthSweep ArrayDepth::confident_range() const {
  std::vector<float> depths;
  for (const auto& camera : cameras_)
    for (size_t i = 0; i < camera->depth.inverse.size(); i++)
      if (camera->depth.confidence[i] >= kConfident) depths.push_back(camera->depth.inverse[i]);
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

std::vector<ArrayDepth::WeightedCamera> ArrayDepth::cameras_around(const Vec3& eye, size_t first) const {
  std::vector<size_t> order(cameras_.size());
  std::iota(order.begin(), order.end(), 0);
  const auto distance = [&](size_t i) { return glm::distance(cameras_[i]->image.pose.position, eye); };
  std::ranges::stable_sort(order, {}, distance);
  const size_t end = std::min(first + kCameras, order.size());
  const double beyond = order.size() > end ? distance(order[end]) : 2 * distance(order[end - 1]);
  std::vector<WeightedCamera> chosen;
  for (size_t k = first; k < end; k++) {
    const double share = beyond > 0 ? distance(order[k]) / beyond : 0;
    chosen.push_back({cameras_[order[k]].get(), static_cast<float>(std::sqrt((1 - share) / (share + 0.02)))});
  }
  return chosen;
}

// Tells how well the depth maps of some cameras agree with a depth on a line of sight of a view.
class ArrayDepth::DepthAgreement {
 public:
  static constexpr float kTolerance = 1.5f;  // steps of the cameras' range
  // The least agreement at which a surface counts as found.
  static constexpr float kAccepted = 0.2f;

  DepthAgreement(const View& view, std::vector<WeightedCamera> cameras, const DepthSweep& range)
      : cameras_(std::move(cameras)), camera_step_(static_cast<float>(range.step())) {
    const Mat3 to_world = view.pose.rotation();
    for (const auto& [camera, weight] : cameras_) {
      const MatchingImage& image = camera->image;
      const Mat3 to_camera = glm::transpose(image.pose.rotation());
      const Mat3 to_image = Mat3(image.focal, 0, 0, 0, image.focal, 0, image.centre.x, image.centre.y, 1) * to_camera;
      projections_.push_back({to_image, to_image * (view.pose.position - image.pose.position)});
      from_view_.emplace_back(to_image * to_world);
    }
  }

  const std::vector<WeightedCamera>& cameras() const { return cameras_; }

  // A line of sight at infinity, in the image of each camera.
  using Line = std::array<Vec3, kCameras>;
  // `ray` is its direction in world coordinates.
  Line line(const Vec3& ray) const {
    Line far;
    for (size_t k = 0; k < cameras_.size(); k++) far[k] = projections_[k].to_image * ray;
    return far;
  }

  // Returns the agreement of the cameras at an inverse depth along the view's axis, 0 to 1, or nothing if no camera
  // sees the point. Agreement of a small part of the cameras is not reliable, and counts less.
  std::optional<float> at(const Line& far, double inverse) const {
    float agreeing = 0, seeing = 0, present = 0;
    for (size_t k = 0; k < cameras_.size(); k++) {
      const auto& [camera, weight] = cameras_[k];
      const MatchingImage& image = camera->image;
      const Vec3 at = far[k] + inverse * projections_[k].parallax;
      if (!(at.z > 0)) continue;
      const double x = at.x / at.z + 0.5, y = at.y / at.z + 0.5;
      if (!(x >= 0 && y >= 0 && x < image.width && y < image.height)) continue;
      const size_t at_pixel = static_cast<size_t>(y) * image.width + static_cast<size_t>(x);
      const float behind = static_cast<float>(inverse / at.z - camera->depth.inverse[at_pixel]) / camera_step_;
      const float trust = weight * std::max(kMinConfidence, camera->depth.confidence[at_pixel]);
      present += weight;
      agreeing += trust * std::max(0.f, 1 - std::abs(behind) / kTolerance);
      if (behind > -kTolerance) seeing += trust;
    }
    if (!(seeing > 0)) return {};
    return agreeing / seeing * std::min(1.f, seeing / (0.1f * present));
  }

  // Does the same for the pixels of a cell, in float. The lines of sight are (u, v, 1) in coordinates of the view. The
  // agreement is 0 where no camera sees the point.
  DepthEdges::Cell at(const DepthEdges::Cell& u, const DepthEdges::Cell& v, const DepthEdges::Cell& inverse) const {
    DepthEdges::Cell agreeing{}, seeing{}, present{};
    const float per_step = 1 / camera_step_;
    for (size_t k = 0; k < cameras_.size(); k++) {
      const auto& [camera, weight] = cameras_[k];
      const glm::mat3& far = from_view_[k];
      const glm::vec3 parallax(projections_[k].parallax);
      const auto width = static_cast<float>(camera->image.width), height = static_cast<float>(camera->image.height);
      const int columns = camera->image.width;
      const float* const measured = camera->depth.inverse.data();
      const float* const confidence = camera->depth.confidence.data();
      const float of_camera = weight;
      for (size_t i = 0; i < u.size(); i++) {
        const float per_z = 1 / (far[0].z * u[i] + far[1].z * v[i] + far[2].z + inverse[i] * parallax.z);
        const float x = (far[0].x * u[i] + far[1].x * v[i] + far[2].x + inverse[i] * parallax.x) * per_z + 0.5f;
        const float y = (far[0].y * u[i] + far[1].y * v[i] + far[2].y + inverse[i] * parallax.y) * per_z + 0.5f;
        if (!(per_z > 0 && x >= 0 && y >= 0 && x < width && y < height)) continue;
        const int pixel = static_cast<int>(y) * columns + static_cast<int>(x);
        const float behind = (inverse[i] * per_z - measured[pixel]) * per_step;
        const float trust = of_camera * std::max(kMinConfidence, confidence[pixel]);
        present[i] += of_camera;
        agreeing[i] += trust * std::max(0.f, 1 - std::abs(behind) / kTolerance);
        seeing[i] += behind > -kTolerance ? trust : 0;
      }
    }
    for (size_t i = 0; i < u.size(); i++)
      agreeing[i] = seeing[i] > 0 ? agreeing[i] / seeing[i] * std::min(1.f, seeing[i] / (0.1f * present[i])) : 0;
    return agreeing;
  }

 private:
  static constexpr float kMinConfidence = 0.05f;
  const std::vector<WeightedCamera> cameras_;
  const float camera_step_;  // 1/m
  // Of each camera: a line of sight at the inverse depth d falls on (p.x / p.z, p.y / p.z) with p = to_image * line + d
  // * parallax.
  struct Projection {
    Mat3 to_image;
    Vec3 parallax;
  };
  std::vector<Projection> projections_;
  std::vector<glm::mat3> from_view_;  // to_image for lines in coordinates of the view
};

// Finds the points of one view's surface. Only depths that one of the cameras has measured near a line of sight are
// tested; these are a tenth of all depths.
class ArrayDepth::ViewPoints {
 public:
  ViewPoints(const View& view, const FocalMap& map, std::vector<WeightedCamera> cameras, const DepthSweep& range)
      : view_(view), map_(map), agreement_(view, std::move(cameras), range) {
    const Mat3 to_view = glm::transpose(view.pose.rotation());
    // The range as seen from the eye, which may be in front of the cameras or behind.
    double forward = 0;
    const std::vector<WeightedCamera>& used = agreement_.cameras();
    for (const auto& [camera, weight] : used)
      forward -= (to_view * (camera->image.pose.position - view.pose.position)).z / static_cast<double>(used.size());
    const auto from_eye = [&](double inverse) { return inverse / std::max(1 - inverse * forward, 1. / kMaxNearer); };
    farthest_ = from_eye(range.farthest);
    const double nearest = from_eye(range.nearest);
    steps_ = std::clamp(static_cast<int>(std::ceil((nearest - farthest_) / range.step() * kPerStep)) + 1, 2, kMaxSteps);
    step_ = (nearest - farthest_) / (steps_ - 1);
    measured_.resize(static_cast<size_t>(map.columns) * map.rows);
    for (const auto& [camera, weight] : used) add(*camera);
    // Depths agree with the measured ones around them.
    constexpr int kAround = static_cast<int>(DepthAgreement::kTolerance * kPerStep + 0.5f);
    for (Depths& depths : measured_) {
      const Depths exact = depths;
      for (int k = 1; k <= kAround; k++) depths |= exact << k | exact >> k;
    }
  }

  // Sets the inverse distances from the plane of the map for the nodes of a row where they are 0. They stay 0 where no
  // camera sees anything.
  void find(int row, float* inverse) const {
    const double middle = (map_.step - 1) / 2.0, eye = map_.from.signed_distance(view_.pose.position);
    const Mat3 to_world = view_.pose.rotation();
    for (int i = 0; i < map_.columns; i++) {
      if (inverse[i] > 0) continue;
      const std::optional<Vec2> normalised = view_.lens.unproject({map_.step * i + middle, map_.step * row + middle});
      if (!normalised) continue;
      const Vec3 ray = to_world * Vec3(*normalised, 1);
      const double depth = find_on(ray, measured_[row * map_.columns + i]);
      const double distance = eye * depth + glm::dot(map_.from.normal, ray);  // times the depth
      inverse[i] = distance > 0 ? static_cast<float>(depth / distance) : 0;
    }
  }

 private:
  static constexpr int kPerStep = 2;         // tested depths for each step of the cameras' range
  static constexpr int kMaxSteps = 512;      // tested depths
  static constexpr double kMaxNearer = 4;    // largest ratio of inverse distances from the eye and from the cameras
  using Depths = std::bitset<kMaxSteps>;

  // Marks the depths that a camera has measured, at the nodes where they appear.
  void add(const Camera& camera) {
    const MatchingImage& image = camera.image;
    const Mat3 turn = glm::transpose(view_.pose.rotation()) * image.pose.rotation();
    const Vec3 shift = glm::transpose(view_.pose.rotation()) * (image.pose.position - view_.pose.position);
    const double size = view_.lens.fx() / (image.focal * map_.step);  // side of a pixel, in nodes
    for (int y = 0; y < image.height; y++)
      for (int x = 0; x < image.width; x++) {
        const double inverse = camera.depth.inverse[static_cast<size_t>(y) * image.width + x];
        const Vec3 point = turn * image.ray(x, y) + inverse * shift;  // times the depth
        if (!(point.z > 0)) continue;
        const std::optional<Vec2> at = view_.lens.project(point);
        if (!at) continue;
        const double reach = std::min(0.5 * size * std::max(1., 1 / point.z), kMaxNodes) + 0.01;
        const Vec2 node = (*at + 0.5) / static_cast<double>(map_.step) - 0.5;
        const int left = std::max(static_cast<int>(std::floor(node.x - reach + 0.5)), 0);
        const int right = std::min(static_cast<int>(std::floor(node.x + reach + 0.5)), map_.columns - 1);
        const int top = std::max(static_cast<int>(std::floor(node.y - reach + 0.5)), 0);
        const int bottom = std::min(static_cast<int>(std::floor(node.y + reach + 0.5)), map_.rows - 1);
        if (left > right || top > bottom) continue;
        const int depth = static_cast<int>(std::lround((inverse / point.z - farthest_) / step_));
        for (int j = top; j <= bottom; j++)
          for (int i = left; i <= right; i++)
            measured_[static_cast<size_t>(j) * map_.columns + i].set(std::clamp(depth, 0, steps_ - 1));
      }
  }

  // Returns the inverse depth, along the view's axis, of the surface on a line of sight. The line's direction is in
  // world coordinates. Returns 0 if no camera sees anything there.
  double find_on(const Vec3& ray, const Depths& depths) const {
    // The first peak of sufficient agreement is taken, once the agreement has fallen to this part of it.
    constexpr float kFallen = 0.8f;
    constexpr double kInfinite = 1e-6;  // 1/m
    const DepthAgreement::Line line = agreement_.line(ray);
    float most = 0;
    double found = 0;
    for (int i = steps_ - 1; i >= 0; i--) {
      if (!depths[i]) {
        if (most > DepthAgreement::kAccepted) break;
        continue;
      }
      const double inverse = farthest_ + i * step_;
      const std::optional<float> agreement = agreement_.at(line, inverse);
      if (!agreement) continue;
      if (*agreement > most) {
        most = *agreement;
        found = std::max(inverse, kInfinite);
      }
      if (most > DepthAgreement::kAccepted && *agreement < kFallen * most) break;
    }
    return found;
  }

  static constexpr double kMaxNodes = 8;  // largest distance of the nodes that a pixel covers from its centre
  const View& view_;
  const FocalMap& map_;
  const DepthAgreement agreement_;
  double farthest_ = 0, step_ = 0;
  int steps_ = 0;
  std::vector<Depths> measured_;  // of each node
};

namespace {

// Tests whether a camera sees points of a view's focal surface.
class VisibilityTest {
 public:
  VisibilityTest(const View& view, const MatchingImage& image, const std::vector<float>& inverse, double step)
      : image_(image), inverse_(inverse), per_step_(static_cast<float>(1 / step)) {
    const FocalMap& map = *view.focus.map;
    const Mat3 to_world = view.pose.rotation(), to_camera = glm::transpose(image.pose.rotation());
    const Mat3 to_image = Mat3(image.focal, 0, 0, 0, image.focal, 0, image.centre.x, image.centre.y, 1) * to_camera;
    image_from_ray_ = to_image * to_world;
    parallax_ = to_image * (view.pose.position - image.pose.position);
    normal_ = glm::transpose(to_world) * map.from.normal;
    const double eye = map.from.signed_distance(view.pose.position);
    eye_ = static_cast<float>(eye);
    for (size_t level = 0; level < depth_.size(); level++) {
      const double from_plane = map.inverse_of(static_cast<double>(level));
      depth_[level] = static_cast<float>(from_plane / (1 - from_plane * eye));
    }
  }

  // Returns a mask value, from the part of the camera's pixels around the point that do not see anything nearer. The
  // point is on the line of sight `ray` of the view, with Z = 1.
  uint8_t at_level(const glm::vec3& ray, uint8_t level) const { return mask_value(part_seen(ray, depth_[level])); }
  // Does the same for a point with an inverse distance from the plane of the map.
  uint8_t at_inverse(const glm::vec3& ray, float from_plane) const {
    return mask_value(part_seen(ray, from_plane / (1 - from_plane * eye_)));
  }

 private:
  static uint8_t mask_value(float seen) {
    constexpr float kRange = VisibilityMask::kVisible - VisibilityMask::kHidden;
    return static_cast<uint8_t>(VisibilityMask::kHidden + kRange * seen + 0.5f);
  }

  // `along_normal` is the inverse depth of the point on a line of sight along the normal of the map's plane.
  float part_seen(const glm::vec3& ray, float along_normal) const {
    // A point is hidden by depths that are nearer by more than kHiddenBy steps of the range, and visible up to one step
    // less.
    constexpr float kHiddenBy = 2.5f;
    const float depth = along_normal * glm::dot(normal_, ray);  // inverse
    const glm::vec3 at = image_from_ray_ * ray + depth * parallax_;
    if (!(at.z > 0 && depth >= 0)) return 1;
    const float per_z = 1 / at.z, x = at.x * per_z, y = at.y * per_z;
    if (!(x >= 0 && y >= 0 && x < static_cast<float>(image_.width - 1) && y < static_cast<float>(image_.height - 1)))
      return 1;
    const int left = static_cast<int>(x), top = static_cast<int>(y);
    const float* const tap = &inverse_[static_cast<size_t>(top) * image_.width + left];
    const float own = depth * per_z;
    const auto sees = [&](float measured) { return std::clamp((own - measured) * per_step_ + kHiddenBy, 0.f, 1.f); };
    const float u = x - static_cast<float>(left), v = y - static_cast<float>(top);
    return (1 - v) * ((1 - u) * sees(tap[0]) + u * sees(tap[1])) +
           v * ((1 - u) * sees(tap[image_.width]) + u * sees(tap[image_.width + 1]));
  }

  const MatchingImage& image_;
  const std::vector<float>& inverse_;
  const float per_step_;
  // A line of sight at the inverse depth d falls on (p.x / p.z, p.y / p.z) with p = image_from_ray_ * ray + d *
  // parallax_.
  glm::mat3 image_from_ray_;
  glm::vec3 parallax_, normal_;
  float eye_;                     // distance of the viewpoint from the plane of the map
  std::array<float, 256> depth_;  // of each level, for a line of sight along the normal of the map's plane
};

// Returns the lines of sight of a lens.
class LinesOfSight {
 public:
  explicit LinesOfSight(const Lens& lens)
      : lens_(lens),
        is_pinhole_(!lens.has_distortion()),
        per_fx_(static_cast<float>(1 / lens.fx())),
        per_fy_(static_cast<float>(1 / lens.fy())),
        cx_(static_cast<float>(lens.cx())),
        cy_(static_cast<float>(lens.cy())) {}

  // Returns the direction of a pixel's line of sight, with Z = 1. Returns nothing if there is no such line.
  std::optional<glm::vec3> at(float x, float y) const {
    if (is_pinhole_) return glm::vec3((x - cx_) * per_fx_, (y - cy_) * per_fy_, 1);
    const std::optional<Vec2> through_lens = lens_.unproject({x, y});
    if (!through_lens) return {};
    return glm::vec3(through_lens->x, through_lens->y, 1);
  }

 private:
  const Lens& lens_;
  const bool is_pinhole_;
  const float per_fx_, per_fy_, cx_, cy_;
};

}  // namespace

std::optional<VisibilityMask> ArrayDepth::visibility(const View& view, CameraIndex index, std::span<const Rect> parts,
                                                     const DepthEdges* edges) const {
  const auto found = std::ranges::find(cameras_, index, [](const auto& camera) { return camera->index; });
  if (found == cameras_.end() || !view.focus.map) return {};
  const FocalMap& map = *view.focus.map;
  VisibilityMask mask{map.columns, map.rows, {}, {}};
  mask.nodes.assign(map.levels.size(), VisibilityMask::kVisible);
  const VisibilityTest visible(view, (*found)->image, (*found)->depth.inverse, range_.step());
  const auto step = static_cast<float>(map.step);
  const LinesOfSight lines(view.lens);
  for (const Rect& part : parts) {
    const int right = std::min(FocalMap::nodes(part.x1, map.step) + 1, map.columns);
    const int bottom = std::min(FocalMap::nodes(part.y1, map.step) + 1, map.rows);
    for (int j = std::max(part.y0 / map.step - 1, 0); j < bottom; j++)
      for (int i = std::max(part.x0 / map.step - 1, 0); i < right; i++) {
        const std::optional<glm::vec3> ray =
            lines.at((static_cast<float>(i) + 0.5f) * step - 0.5f, (static_cast<float>(j) + 0.5f) * step - 0.5f);
        if (!ray) continue;
        const size_t node = static_cast<size_t>(j) * map.columns + i;
        mask.nodes[node] = visible.at_level(*ray, map.levels[node]);
      }
  }
  if (!edges) return mask;
  mask.edges.resize(edges->cells.size());
  for (const Rect& part : parts)
    for (int j = DepthEdges::cell_of(part.y0); j <= DepthEdges::cell_of(part.y1 - 1); j++)
      for (int i = DepthEdges::cell_of(part.x0); i <= DepthEdges::cell_of(part.x1 - 1); i++) {
        const int32_t cell = edges->index_of(i, j);
        for (int k = 0; cell >= 0 && k < DepthEdges::kPixels; k++) {
          const auto [x, y] = DepthEdges::pixel_of(i, j, k);
          const std::optional<glm::vec3> ray = lines.at(static_cast<float>(x), static_cast<float>(y));
          const float inverse = edges->cells[static_cast<size_t>(cell)][k];
          mask.edges[static_cast<size_t>(cell)][k] = ray ? visible.at_inverse(*ray, inverse) : VisibilityMask::kVisible;
        }
      }
  return mask;
}

DepthEdges ArrayDepth::edges(const View& view, const ParallelFor& parallel) const {
  // Corners are on different surfaces if their depths differ by more than this number of steps of the range.
  constexpr double kApart = 4;
  const FocalMap& map = *view.focus.map;
  DepthEdges out(map, kApart * range_.step());
  std::vector<WeightedCamera> cameras = cameras_around(view.pose.position);
  cameras.resize(std::min<size_t>(cameras.size(), kEdgeCameras));
  const DepthAgreement agreement(view, std::move(cameras), range_);
  const glm::vec3 normal(glm::transpose(view.pose.rotation()) * map.from.normal);
  const auto eye = static_cast<float>(map.from.signed_distance(view.pose.position));
  const LinesOfSight lines(view.lens);
  parallel(static_cast<size_t>(out.rows), [&](size_t j) {
    for (int i = 0; i < out.columns; i++) {
      const int32_t index = out.index_of(i, static_cast<int>(j));
      if (index < 0) continue;
      const DepthEdges::Sides sides(map, i, static_cast<int>(j));
      DepthEdges::Cell u, v, near, far, near_depth, far_depth;  // the depths are inverse, along the view's axis
      for (int k = 0; k < DepthEdges::kPixels; k++) {
        const auto [x, y] = DepthEdges::pixel_of(i, static_cast<int>(j), k);
        const glm::vec3 ray = lines.at(static_cast<float>(x), static_cast<float>(y)).value_or(glm::vec3(0, 0, 1));
        const auto [of_near, of_far] = sides.inverse_at(k);
        u[k] = ray.x, v[k] = ray.y;
        near[k] = static_cast<float>(of_near), far[k] = static_cast<float>(of_far);
        const float along = glm::dot(normal, ray);
        near_depth[k] = near[k] * along / (1 - near[k] * eye);
        far_depth[k] = far[k] * along / (1 - far[k] * eye);
      }
      const DepthEdges::Cell of_near = agreement.at(u, v, near_depth);
      const auto is_accepted = [](float of) { return of > DepthAgreement::kAccepted; };
      DepthEdges::Cell& cell = out.cells[static_cast<size_t>(index)];
      cell = near;
      if (std::ranges::all_of(of_near, is_accepted)) continue;
      const DepthEdges::Cell of_far = agreement.at(u, v, far_depth);
      for (size_t k = 0; k < cell.size(); k++)
        if (!is_accepted(of_near[k]) && of_near[k] < of_far[k]) cell[k] = far[k];
    }
  });
  return out;
}

FocalMap ArrayDepth::surface(const View& view, const ParallelFor& parallel) const {
  FocalMap map = FocalMap::for_view(view.width, view.height);
  map.from = plane_through(view.pose.position, view.pose.rotation()[2]);
  return surface(view, map, parallel);
}

FocalMap ArrayDepth::surface(const View& view, const FocalMap& like, const ParallelFor& parallel) const {
  FocalMap map = like;
  map.levels.clear();
  map.measured = true;
  std::vector<float> inverse(static_cast<size_t>(map.columns) * map.rows);
  // Farther cameras may see nodes that the nearest cameras do not see.
  for (size_t first = 0; first < cameras_.size() && std::ranges::count(inverse, 0.f) > 0; first += kCameras) {
    const ViewPoints points(view, map, cameras_around(view.pose.position, first), range_);
    parallel(static_cast<size_t>(map.rows),
             [&](size_t row) { points.find(static_cast<int>(row), &inverse[row * map.columns]); });
  }
  const std::vector<float> smooth = without_outliers(inverse, map.columns, map.rows, range_.step());

  float least = std::numeric_limits<float>::infinity(), largest = 0;
  for (const float value : smooth) {
    if (value > 0) least = std::min(least, value);
    largest = std::max(largest, value);
  }
  if (!(largest > 0)) least = largest = static_cast<float>(range_.farthest);
  map.nearest = std::max<double>(largest, least * 1.001 + 1e-6);
  // Level 1 is `least`, unless this would be beyond infinity.
  map.farthest = std::max(least - (map.nearest - least) / (FocalMap::kLevels - 1), 0.);
  map.levels.reserve(smooth.size());
  for (const float value : smooth) map.levels.push_back(value > 0 ? std::max<uint8_t>(map.level_of(value), 1) : 0);
  return map;
}

}  // namespace lf
