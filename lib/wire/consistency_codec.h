// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/maths.h"
#include "base/memory.h"
#include "focus/exposure_compensation.h"
#include "focus/photo_consistency.h"

namespace lf::wire {

// The photo-consistency sums of a node's cameras for the depth hypotheses of a request: a unit of the answer stream
// before the node's fragments; see spec.md.
struct ConsistencyHeader {
  uint32_t view_id = 0, sequence = 0;
  uint64_t rig_hash = 0;
  uint32_t node = 0;
  // The exposure gains of the node's cameras, in a unit for exposure compensation: its one hypothesis holds the
  // cameras' view with wide weights. nullopt in a unit for the request's depth hypotheses.
  std::optional<GainSum> gains;
  bool operator==(const ConsistencyHeader&) const = default;
};
// The map size in nodes and the number of depth hypotheses of a request.
struct ConsistencyShape {
  int columns = 0, rows = 0;
  size_t trials = 0;
  bool operator==(const ConsistencyShape&) const = default;
};
struct ConsistencyUnit : ConsistencyHeader {
  ConsistencyShape shape;
  Rect rect;                             // all map nodes with any weight are inside
  std::vector<PhotoConsistency> trials;  // nodes in `rect`, for each hypothesis in request order

  // add_to() adds the hypotheses to sums over the whole map (with the sizes in `shape`); sums() returns such sums.
  void add_to(std::span<PhotoConsistency> sums) const;
  std::vector<PhotoConsistency> sums() const;
};

bool is_consistency(std::span<const uint8_t> bytes);
// Throws Error for no hypothesis, more than kMaxHypotheses, or different sizes. `small`: compresses the sums of a
// single camera to a sixth of the bytes, at some cost in time.
ByteBuffer encode_consistency(const ConsistencyHeader& header, std::span<const PhotoConsistency> trials,
                              bool small = false);
// Parses the start of a photo-consistency unit and sets *shape (may be null). On failure returns nullopt and sets
// *reason (may be null).
std::optional<ConsistencyHeader> parse_consistency_header(std::span<const uint8_t> bytes,
                                                          ConsistencyShape* shape = nullptr,
                                                          std::string* reason = nullptr);
// Decodes exactly one photo-consistency unit of this shape. On failure returns nullopt and sets *reason (may be null).
// Allocates memory only for the nodes in the unit's rectangle, which are in `bytes`.
std::optional<ConsistencyUnit> decode_consistency(std::span<const uint8_t> bytes, const ConsistencyShape& expected,
                                                  std::string* reason = nullptr);

}  // namespace lf::wire
