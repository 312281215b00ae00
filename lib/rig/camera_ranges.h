// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>
#include <vector>

#include "rig/mesh.h"

namespace lf {

// A run of cameras with neighbouring indices, both ends included.
struct CameraRange {
  CameraIndex first = 0, last = 0;
  auto operator<=>(const CameraRange&) const = default;
};

// A set of cameras as ascending runs that neither touch nor overlap: how nodes, which have rows or blocks of an array,
// name their cameras briefly.
class CameraRanges {
 public:
  CameraRanges() = default;
  // Ascending, no repeats.
  explicit CameraRanges(std::span<const CameraIndex> cameras);

  // Appends a run; false, and nothing is changed, if it does not lie beyond the others with a gap or is upside down.
  bool append(const CameraRange& range);
  void add(const CameraRanges& other);
  void remove(const CameraRanges& other);

  bool contains(CameraIndex camera) const;
  bool contains(const CameraRanges& other) const;
  bool intersects(const CameraRanges& other) const;
  bool empty() const { return ranges_.empty(); }
  size_t size() const;  // number of cameras
  CameraSet cameras() const;
  const std::vector<CameraRange>& ranges() const { return ranges_; }
  auto operator<=>(const CameraRanges&) const = default;  // any order, for maps

 private:
  std::vector<CameraRange> ranges_;
};

}  // namespace lf
