// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/source_region.h"

#include <algorithm>
#include <cmath>

#include "render/camera_projection.h"

namespace lf {
namespace {

constexpr int kStep = 16;  // pixels of the view between two that are looked at
// Sampling reaches two pixels further, chroma five; positions that the fast renderer interpolates are off by less than
// one.
constexpr int kReach = 6;

// Around the outermost pixels of `rect`, kStep apart, corners included, from the first one back to it, as long as
// `call` is true.
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

// The middle of a chroma sample may lie beyond the rectangle.
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
  double largest_step = 0;  // between neighbours
  bool known = true;
  // Between two distances a position moves along a line.
  double distances[2] = {0, 0};
  int num_distances = 1;
  if (const FocalMap* map = plan.view().focus.map.get(); map) {
    distances[0] = map->inverse_of(levels.least);
    distances[1] = map->inverse_of(levels.largest);
    num_distances = levels.least == levels.largest ? 1 : 2;
  }
  // For each distance along the border: neither a homography nor a lens has what is inside end up outside.
  for (int k = 0; k < num_distances && known; k++) {
    Vec2 before(NAN);
    const auto look = [&](int x, int y) {
      Vec2 pixel;
      if (!projection.project_beyond(plan.rays().at(x, y), distances[k], pixel)) return false;
      low = glm::min(low, pixel);
      high = glm::max(high, pixel);
      if (!std::isnan(before.x)) largest_step = std::max(largest_step, glm::distance(pixel, before));
      before = pixel;
      return true;
    };
    known = for_border(rect, look);
  }
  // Not before NaN and infinity are ruled out: they can't become integers.
  if (!known || !std::isfinite(low.x + low.y + high.x + high.y)) return whole;
  // Between the points looked at a curved edge bulges by less than a sixteenth of their distance, unless the lens bends
  // it more than any that a picture is taken with.
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

}  // namespace lf
