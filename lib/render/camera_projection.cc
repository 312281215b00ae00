// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/camera_projection.h"

#include <algorithm>
#include <cmath>

namespace lf {

CameraProjection::CameraProjection(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera)
    : has_map_(plan.view().focus.map != nullptr),
      eye_distance_(plan.eye_distance()),
      lens_(rig_camera.lens),
      distorted_(rig_camera.lens.has_distortion()),
      right_(rig_camera.width - 0.5),
      bottom_(rig_camera.height - 0.5) {
  if (const Mat3* homography = plan.explicit_homography(camera)) {
    camera_from_ray_ = *homography;
    return;
  }
  const Pose& view = plan.view().pose;
  const Mat3 camera_from_world = glm::transpose(rig_camera.pose.rotation());
  const Mat3 camera_from_view = camera_from_world * view.rotation();
  const Vec3 eye_in_camera = camera_from_world * (view.position - rig_camera.pose.position);
  if (has_map_) {
    camera_from_ray_ = camera_from_view;
    per_inverse_ = glm::outerProduct(eye_in_camera, plan.focal_normal()) - eye_distance_ * camera_from_view;
    return;
  }
  const double c = plan.focal_offset(), sign = c > 0 ? 1 : -1;
  camera_from_ray_ = sign * (c * camera_from_view + glm::outerProduct(eye_in_camera, plan.focal_normal()));
}

namespace {

constexpr int kStep = 16;  // pixels of the view between sample points
// Margin around the projected positions, in pixels. Bilinear sampling reads two more pixels, chroma reads five, and the
// fast renderer interpolates positions with an error of less than one pixel.
constexpr int kReach = 6;

// Calls call(x, y) for points along the border of `rect`, at most kStep apart, with the corners and finally the first
// point again. Stops when `call` returns false.
template <typename Call>
bool for_border(const Rect& rect, Call call) {
  const int right = rect.x1 - 1, bottom = rect.y1 - 1;
  for (int x = rect.x0; x < right; x += kStep)
    if (!call(x, rect.y0)) return false;
  for (int y = rect.y0; y < bottom; y += kStep)
    if (!call(right, y)) return false;
  for (int x = right; x > rect.x0; x -= kStep)
    if (!call(x, bottom)) return false;
  for (int y = bottom; y > rect.y0; y -= kStep)
    if (!call(rect.x0, y)) return false;
  return call(rect.x0, rect.y0);
}

constexpr FocalMap::LevelRange kNoLevels{0, 0};

// Returns the range of levels in `rect`, with a margin, because the middle of a chroma sample may lie outside `rect`.
FocalMap::LevelRange levels_in(const FocalMap& map, std::span<const uint8_t> levels, const Rect& rect) {
  return map.range_of(levels, rect.x0, rect.y0, rect.x1, rect.y1);
}

Rect whole_samples(const Rect& region, const Camera& camera) {
  if (region.empty()) return {0, 0, 1, 1};
  return {region.x0 & ~1, region.y0 & ~1, std::min((region.x1 + 1) & ~1, camera.width),
          std::min((region.y1 + 1) & ~1, camera.height)};
}

}  // namespace

Rect source_region(const ViewPlan& plan, const Rect& rect, CameraIndex camera, const Camera& rig_camera,
                   const FocalMap::LevelRange& levels) {
  const Rect whole{0, 0, rig_camera.width, rig_camera.height};
  if (rect.empty()) return {};
  const CameraProjection projection(plan, camera, rig_camera);
  Vec2 low(INFINITY), high(-INFINITY);
  double largest_step = 0;
  bool known = true;
  // If the distance of a point on a line of sight changes, the point moves along a straight line in the image (the
  // epipolar line). Projecting the smallest and the largest distance is therefore enough. Fisheye lenses bend the line.
  constexpr int kBentDistances = 9;
  double distances[kBentDistances] = {};
  int num_distances = 1;
  if (const FocalMap* map = plan.view().focus.map.get(); map) {
    if (levels.least != levels.largest) num_distances = rig_camera.lens.distortion().fisheye ? kBentDistances : 2;
    const double first = map->inverse_of(levels.least), last = map->inverse_of(levels.largest);
    for (int k = 0; k < num_distances; k++) distances[k] = first + (last - first) * k / std::max(num_distances - 1, 1);
  }
  // Walk around the border for each distance, because homographies and lenses map the inside of `rect` to the inside of
  // its border. Fisheye cameras are an exception: their field may surround the part of `rect` behind the camera.
  for (int k = 0; k < num_distances && known; k++) {
    Vec2 before(NAN);
    const auto look = [&](int x, int y) {
      Vec2 pixel;
      const Vec2 ray = plan.rays().at(x, y);
      if (!projection.project_unbounded(ray, distances[k], pixel) || !(projection.point(ray, distances[k]).z > 0))
        return false;
      low = glm::min(low, pixel);
      high = glm::max(high, pixel);
      if (!std::isnan(before.x)) largest_step = std::max(largest_step, glm::distance(pixel, before));
      before = pixel;
      return true;
    };
    known = for_border(rect, look);
  }
  // NaN and infinity must be ruled out before the conversion to int.
  if (!known || !std::isfinite(low.x + low.y + high.x + high.y)) return whole;
  // A curved border bulges between two sample points by less than a sixteenth of their distance, except for lenses with
  // extreme distortion.
  const Vec2 margin(largest_step / 16 + kReach);
  low = glm::max(low - margin, Vec2(0));
  high = glm::min(high + margin, Vec2(rig_camera.width, rig_camera.height));
  if (low.x >= high.x || low.y >= high.y) return {};
  return intersect(whole, {static_cast<int>(std::floor(low.x)), static_cast<int>(std::floor(low.y)),
                           static_cast<int>(std::ceil(high.x)) + 1, static_cast<int>(std::ceil(high.y)) + 1});
}

Rect source_region(const ViewPlan& plan, const Rect& rect, CameraIndex camera, const Camera& rig_camera) {
  const FocalMap* map = plan.view().focus.map.get();
  return source_region(plan, rect, camera, rig_camera, map ? levels_in(*map, map->levels, rect) : kNoLevels);
}

Rect needed_pixels(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera) {
  const Rect rect = chroma_aligned(plan.camera_rect(camera), plan.view());
  return whole_samples(source_region(plan, rect, camera, rig_camera), rig_camera);
}

Rect needed_pixels(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera,
                   std::span<const std::vector<uint8_t>> maps) {
  const Rect rect = chroma_aligned(plan.camera_rect(camera), plan.view());
  FocalMap::LevelRange all{255, 0};
  for (const std::vector<uint8_t>& levels : maps) {
    const FocalMap::LevelRange range = levels_in(*plan.view().focus.map, levels, rect);
    all = {std::min(all.least, range.least), std::max(all.largest, range.largest)};
  }
  const Rect region = source_region(plan, rect, camera, rig_camera, all);
  return region.empty() ? region : whole_samples(region, rig_camera);
}

bool is_pixel_for_pixel(const View& view, const Camera& camera) {
  constexpr double kSame = 1.0 / 16;
  const double offset = glm::length(camera.pose.position - view.pose.position);
  const double distance = std::abs(view.focus.plane.signed_distance(view.pose.position));
  if (!(offset * camera.lens.fy() <= kSame * distance)) return false;
  // The shift must be the same whole number of pixels in the middle and in the corners.
  const Vec2 middle(std::floor((view.width - 1) / 2.0), std::floor((view.height - 1) / 2.0));
  const Vec2 last(view.width - 1, view.height - 1);
  std::optional<Vec2> shift;
  for (const Vec2& pixel : {middle, Vec2(0, 0), Vec2(last.x, 0), Vec2(0, last.y), last}) {
    const std::optional<Vec2> ray = view.lens.unproject(pixel);
    if (!ray) return false;
    const Vec3 direction = view.pose.rotation() * Vec3(*ray, 1);
    const std::optional<Vec2> at = camera.lens.project(glm::transpose(camera.pose.rotation()) * direction);
    if (!at) return false;
    if (!shift) shift = Vec2(std::round(at->x - pixel.x), std::round(at->y - pixel.y));
    if (glm::length(*at - pixel - *shift) > kSame) return false;
  }
  return true;
}

}  // namespace lf
