// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/coverage.h"

#include <algorithm>

namespace lf {
namespace {

bool meets_any(const std::vector<Rect>& rects, const Rect& rect) {
  return std::ranges::any_of(rects, [&rect](const Rect& other) { return !intersect(other, rect).empty(); });
}

}  // namespace

template <typename F>
void Coverage::for_each_rect(CameraIndex camera, const F& f) const {
  if (const auto own = cameras_.find(camera); own != cameras_.end()) std::ranges::for_each(own->second, f);
  for (const auto& [cameras, rects] : sums_)
    if (cameras.contains(camera)) std::ranges::for_each(rects, f);
}

bool Coverage::add(CameraIndex camera, const Rect& rect) {
  bool there = false;
  for_each_rect(camera, [&](const Rect& other) { there = there || !intersect(other, rect).empty(); });
  if (!there) cameras_[camera].push_back(rect);
  return !there;
}

bool Coverage::add(const CameraRanges& cameras, const Rect& rect) {
  for (const auto& [others, rects] : sums_)
    if (others.intersects(cameras) && meets_any(rects, rect)) return false;
  for (const auto& [camera, rects] : cameras_)
    if (cameras.contains(camera) && meets_any(rects, rect)) return false;
  sums_[cameras].push_back(rect);
  return true;
}

bool Coverage::has(CameraIndex camera) const {
  bool any = false;
  for_each_rect(camera, [&any](const Rect&) { any = true; });
  return any;
}

void Coverage::take_out(CameraIndex camera, const Rect& rect, std::span<float> weights) const {
  for_each_rect(camera, [&](const Rect& other) {
    const Rect both = intersect(other, rect);
    for (int y = both.y0; y < both.y1; y++)
      std::fill_n(&weights[static_cast<size_t>(y - rect.y0) * rect.width() + (both.x0 - rect.x0)],
                  std::max(both.width(), 0), 0.0f);
  });
}

}  // namespace lf
