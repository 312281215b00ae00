// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "rig/rig.h"
#include "view/views_json.h"

namespace lf {

// A smooth camera path through key views: at each key's time it is at that key, in between it moves along cubic Hermite
// curves whose velocity at a key is (next - previous) / (their times' difference) (Catmull-Rom with times), so velocity
// is continuous everywhere. Orientations: the same curve through sign-aligned quaternions, normalised. Where every
// key's focal plane faces its view, the logarithm of its distance moves so and the plane keeps facing; otherwise the
// planes' [a, b, c, d] do. The lens' numbers move like the position. Immutable; thread-safe.
class ViewPath {
 public:
  // Takes at least one key; times strictly increase, and all have one size and one lens model. Throws Error naming the
  // key.
  explicit ViewPath(std::vector<NamedView> keys);

  double begin() const { return keys_.front().time; }  // seconds
  double end() const { return keys_.back().time; }
  // The view at a time in seconds: before begin() the first key, after end() the last.
  View at(double time) const;
  // Views at begin(), begin() + 1/rate, ... up to and including end() (to a thousandth of a period), named
  // "view_000000", ...
  std::vector<NamedView> sample(double rate_hz) const;

 private:
  std::vector<NamedView> keys_;
  bool planes_face_ = true;
};

// Depths to focus on, metres from the middle of the array along the mean of its axes; 0 < near <= far.
struct FocusRange {
  double near = 0, far = 0;
};

struct TourOptions {
  int width = 0, height = 0;  // pixels of the views; 0: those of the middle camera
  int frames = 1;             // views of the path, at least 1
  double rate_hz = 15;        // views per second
  bool still = false;         // all views at time 0, for a scene that stands still
  double room = 0;            // metres between the outermost eyes of sets of views that will fly it
};

// The view focused on one plane after the other, from the nearest to the farthest: `planes` of them that face it, even
// in inverse distance, so that what is out of focus moves by the same from each to the next. Distances are from the
// eye. Views are named "view_000000", ... All are at time 0. Throws Error for a range that is none and less than one
// plane; one plane is the nearest.
std::vector<NamedView> make_focus_sweep(const View& view, const FocusRange& range, int planes);

// A smooth closed path that shows what an array can do: from its middle to both sides, forward and back, as far as the
// array still covers the whole view, while the focus moves from near to far and back. It begins at the middle with the
// near focus and reaches the far one half-way. Views look along the mean of the cameras' axes and are a little narrower
// than a camera. Where sets of views are to have room for their eyes it goes less far. Requires at least one camera; throws Error if the options are out of range.
std::vector<NamedView> make_tour(const Rig& rig, const FocusRange& focus, const TourOptions& options);

}  // namespace lf
