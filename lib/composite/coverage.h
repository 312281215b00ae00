// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <map>
#include <span>

#include "composite/disjoint_rects.h"
#include "rig/camera_ranges.h"

namespace lf {

// Where in a view which cameras' contributions have come: nothing may be added twice, and what never came is lost.
// Not thread-safe.
class Coverage {
 public:
  void clear() { *this = {}; }

  // A fragment of one camera, or the sum of several. False, and nothing is noted, if one of the cameras has been there
  // already somewhere in the rectangle, or it is one more set of cameras than kMaxSources.
  bool add(CameraIndex camera, const Rect& rect);
  bool add(const CameraRanges& cameras, const Rect& rect);

  bool has(CameraIndex camera) const;  // anywhere
  // Sets to 0 what of `weights`, the camera's weights over `rect` row by row, has come.
  void take_out(CameraIndex camera, const Rect& rect, std::span<float> weights) const;

 private:
  template <typename F>
  void for_each_rect(CameraIndex camera, const F& f) const;

  std::map<CameraIndex, DisjointRects> cameras_;
  std::map<CameraRanges, DisjointRects> sums_;
};

}  // namespace lf
