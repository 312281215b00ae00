// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/byte_buffer.h"
#include "base/rect.h"
#include "focus/camera_gains.h"
#include "focus/moments.h"

namespace lf::wire {

// What cameras have in common through the trial surfaces of one request: a unit of the answer stream that goes before
// the node's fragments; see spec.md.
struct MomentsHeader {
  uint32_t view_id = 0, sequence = 0;
  uint64_t rig_hash = 0;
  uint32_t node = 0;
  // Of what cameras see with wide weights, the one trial of such a unit, for the mean that they compare themselves
  // with: their gains. Nothing: of the request's trials.
  std::optional<GainSum> gains;
  bool operator==(const MomentsHeader&) const = default;
};
// Of the request's map, and how many trials it has: known to whoever has asked.
struct MomentsShape {
  int columns = 0, rows = 0;
  size_t trials = 0;
  bool operator==(const MomentsShape&) const = default;
};
struct MomentsUnit : MomentsHeader {
  MomentsShape shape;
  Rect rect;                    // of the map's nodes: outside of it nothing has any weight
  std::vector<Moments> trials;  // in the order of the request's, of the nodes in the rectangle

  // Adds them to the sums of all nodes, which are as many as the shape says; or makes such sums of them.
  void add_to(std::span<Moments> sums) const;
  std::vector<Moments> sums() const;
};

// Whether a unit of the answer stream is one of moments.
bool is_moments(std::span<const uint8_t> bytes);
// Throws Error if there is no trial, or more than kMaxTrials, or they are not of one size. `small`: what one camera
// alone has given takes a sixth of the bytes, and some time.
ByteBuffer encode_moments(const MomentsHeader& header, std::span<const Moments> trials, bool small = false);
// What a unit is about: its shape may be null. Nothing, and in *reason (may be null) why, if this is not the beginning
// of one.
std::optional<MomentsHeader> parse_moments_header(std::span<const uint8_t> bytes, MomentsShape* shape = nullptr,
                                                  std::string* reason = nullptr);
// Nothing, and in *reason (may be null) why, if this is not exactly one such unit of this shape. Memory: of the nodes
// in its rectangle, whose bytes are there.
std::optional<MomentsUnit> decode_moments(std::span<const uint8_t> bytes, const MomentsShape& expected,
                                          std::string* reason = nullptr);

}  // namespace lf::wire
