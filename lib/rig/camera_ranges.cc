// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/camera_ranges.h"

#include <algorithm>

namespace lf {

CameraRanges::CameraRanges(std::span<const CameraIndex> cameras) {
  for (const CameraIndex camera : cameras) {
    if (!ranges_.empty() && ranges_.back().last + 1 == camera)
      ranges_.back().last = camera;
    else
      ranges_.push_back({camera, camera});
  }
}

bool CameraRanges::append(const CameraRange& range) {
  if (range.first > range.last) return false;
  if (!ranges_.empty() && range.first <= ranges_.back().last + 1) return false;
  ranges_.push_back(range);
  return true;
}

void CameraRanges::add(const CameraRanges& other) {
  std::vector<CameraRange> all;
  std::ranges::merge(ranges_, other.ranges_, std::back_inserter(all), {}, &CameraRange::first, &CameraRange::first);
  ranges_.clear();
  for (const CameraRange& range : all) {
    if (!ranges_.empty() && range.first <= ranges_.back().last + 1)
      ranges_.back().last = std::max(ranges_.back().last, range.last);
    else
      ranges_.push_back(range);
  }
}

void CameraRanges::remove(const CameraRanges& other) {
  std::vector<CameraRange> left;
  auto hole = other.ranges_.begin();
  for (CameraRange range : ranges_) {
    while (hole != other.ranges_.end() && hole->last < range.first) ++hole;
    bool any_left = true;
    for (auto h = hole; h != other.ranges_.end() && h->first <= range.last; ++h) {
      if (h->first > range.first) left.push_back({range.first, h->first - 1});
      any_left = h->last < range.last;
      if (!any_left) break;
      range.first = h->last + 1;
    }
    if (any_left) left.push_back(range);
  }
  ranges_ = std::move(left);
}

bool CameraRanges::contains(CameraIndex camera) const {
  const auto after = std::ranges::upper_bound(ranges_, camera, {}, &CameraRange::first);
  return after != ranges_.begin() && camera <= std::prev(after)->last;
}

bool CameraRanges::contains(const CameraRanges& other) const {
  return std::ranges::all_of(other.ranges_, [this](const CameraRange& range) {
    const auto after = std::ranges::upper_bound(ranges_, range.first, {}, &CameraRange::first);
    return after != ranges_.begin() && range.last <= std::prev(after)->last;
  });
}

bool CameraRanges::intersects(const CameraRanges& other) const {
  for (auto a = ranges_.begin(), b = other.ranges_.begin(); a != ranges_.end() && b != other.ranges_.end();) {
    if (a->last < b->first)
      ++a;
    else if (b->last < a->first)
      ++b;
    else
      return true;
  }
  return false;
}

size_t CameraRanges::size() const {
  size_t count = 0;
  for (const CameraRange& range : ranges_) count += range.last - range.first + 1;
  return count;
}

CameraSet CameraRanges::cameras() const {
  CameraSet all;
  all.reserve(size());
  for (const CameraRange& range : ranges_)
    for (CameraIndex camera = range.first; camera <= range.last; camera++) all.push_back(camera);
  return all;
}

}  // namespace lf
