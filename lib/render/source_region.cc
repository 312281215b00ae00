// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/source_region.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "render/camera_projection.h"
#include "render/fragment_renderer.h"

namespace lf {
namespace {

constexpr int kStep = 16;  // pixels of the view between two that are looked at
// Sampling reaches two pixels further, chroma five; positions that the fast renderer interpolates are off by less than
// one.
constexpr int kReach = 6;

// lo, lo + kStep, ... and the last pixel: of [lo, hi).
template <typename Call>
void for_grid(int lo, int hi, Call call) {
  for (int at = lo; at < hi - 1; at += kStep) call(at);
  call(hi - 1);
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
  double largest_step = 0;  // between neighbours of the grid
  std::vector<Vec2> above;  // the row of the grid before
  bool known = true;
  // Between two distances a position moves along a line.
  std::vector<double> distances{0};
  if (const FocalMap* map = plan.view().focus.map.get())
    distances = {map->inverse_of(levels.least), map->inverse_of(levels.largest)};
  for_grid(rect.y0, rect.y1, [&](int y) {
    std::vector<Vec2> row;
    for_grid(rect.x0, rect.x1, [&](int x) {
      Vec2 pixel;
      for (const double inverse : distances) {
        if (!projection.project_beyond(plan.rays().at(x, y), inverse, pixel)) {
          known = false;
          return;
        }
        low = glm::min(low, pixel);
        high = glm::max(high, pixel);
      }
      if (!row.empty()) largest_step = std::max(largest_step, glm::distance(pixel, row.back()));
      if (row.size() < above.size()) largest_step = std::max(largest_step, glm::distance(pixel, above[row.size()]));
      row.push_back(pixel);
    });
    above = std::move(row);
  });
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
