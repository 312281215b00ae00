// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/coverage.h"

#include <algorithm>

#include "wire/limits.h"

namespace lf {
template <typename F>
void Coverage::for_each_rect(CameraIndex camera, const F& f) const {
  if (const auto own = cameras_.find(camera); own != cameras_.end()) std::ranges::for_each(own->second.rects(), f);
  for (const auto& [cameras, rects] : sums_)
    if (cameras.contains(camera)) std::ranges::for_each(rects.rects(), f);
}

bool Coverage::add(CameraIndex camera, const Rect& rect) {
  for (const auto& [cameras, rects] : sums_)
    if (cameras.contains(camera) && rects.meets(rect)) return false;
  return cameras_[camera].add(rect);
}

bool Coverage::add(const CameraRanges& cameras, const Rect& rect) {
  for (const auto& [others, rects] : sums_)
    if (others != cameras && others.intersects(cameras) && rects.meets(rect)) return false;
  for (const auto& [camera, rects] : cameras_)
    if (cameras.contains(camera) && rects.meets(rect)) return false;
  const auto own = sums_.find(cameras);
  if (own == sums_.end() && sums_.size() >= wire::kMaxSources) return false;
  return (own == sums_.end() ? sums_[cameras] : own->second).add(rect);
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
