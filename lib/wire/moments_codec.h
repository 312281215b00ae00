// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/maths.h"
#include "base/memory.h"
#include "focus/camera_gains.h"
#include "focus/moments.h"

namespace lf::wire {

// What cameras have in common through the trial surfaces of one request: a unit of the answer stream that goes before
// the node's fragments; see spec.md.
struct MomentsHeader {
  uint32_t view_id = 0, sequence = 0;
  uint64_t rig_hash = 0;
  uint32_t node = 0;
  // The gains of the node's cameras, in a unit whose one trial is what they see with wide weights, for the mean that
  // cameras compare themselves with. Nothing in a unit of the request's trials.
  std::optional<GainSum> gains;
  bool operator==(const MomentsHeader&) const = default;
};
// How many columns and rows of nodes the request's map has, and how many trials the request: known to whoever has
// asked.
struct MomentsShape {
  int columns = 0, rows = 0;
  size_t trials = 0;
  bool operator==(const MomentsShape&) const = default;
};
struct MomentsUnit : MomentsHeader {
  MomentsShape shape;
  Rect rect;                    // the nodes of the map that have any weight are in it
  std::vector<Moments> trials;  // one for each trial of the request, in its order, of the nodes in the rectangle

  // add_to() adds the unit's trials to sums over the whole map, of as many trials and map nodes as the shape says;
  // sums() makes such sums of them.
  void add_to(std::span<Moments> sums) const;
  std::vector<Moments> sums() const;
};

// Whether a unit of the answer stream is one of moments.
bool is_moments(std::span<const uint8_t> bytes);
// Throws Error if there is no trial, or more than kMaxTrials, or they are not of one size. `small`: what one camera
// alone has given takes a sixth of the bytes, and some time.
ByteBuffer encode_moments(const MomentsHeader& header, std::span<const Moments> trials, bool small = false);
// The beginning of a unit of moments; *shape (may be null) becomes its shape. Nothing, and in *reason (may be null)
// why, if this is not the beginning of one.
std::optional<MomentsHeader> parse_moments_header(std::span<const uint8_t> bytes, MomentsShape* shape = nullptr,
                                                  std::string* reason = nullptr);
// Nothing, and in *reason (may be null) why, if this is not exactly one unit of moments of this shape. No more memory
// is taken than for the nodes in the unit's rectangle, whose bytes are there.
std::optional<MomentsUnit> decode_moments(std::span<const uint8_t> bytes, const MomentsShape& expected,
                                          std::string* reason = nullptr);

}  // namespace lf::wire
