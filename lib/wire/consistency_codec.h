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

// Photo-consistency sums show how well a node's cameras agree about guessed depths (depth hypotheses).
// A node sends them as a unit in the answer stream, before its fragments; see spec.md. This header precedes the sums.
struct ConsistencyHeader {
  uint32_t view_id = 0, sequence = 0;
  uint64_t rig_hash = 0;
  uint32_t node = 0;
  // The exposure gains of the node's cameras, or nullopt. A unit without gains contains the sums of the request's depth
  // hypotheses. A unit with gains is a brightness measurement for exposure compensation, in the same format. Its only
  // hypothesis is the smoothed current surface, and its sums are the brightness of the cameras there.
  std::optional<GainSum> gains;
  bool operator==(const ConsistencyHeader&) const = default;
};
// The size of a request's focal map, in nodes, and the number of its depth hypotheses.
struct ConsistencyShape {
  int columns = 0, rows = 0;
  size_t hypotheses = 0;
  bool operator==(const ConsistencyShape&) const = default;
};
struct ConsistencyUnit : ConsistencyHeader {
  ConsistencyShape shape;
  Rect rect;                             // contains all map nodes with any weight
  std::vector<PhotoConsistency> hypotheses;  // the nodes in `rect`, for each hypothesis in request order

  // Both functions use arrays that cover the whole map for each hypothesis, with the size in `shape`. add_to() adds
  // this unit to such an array, and sums() returns a new array.
  void add_to(std::span<PhotoConsistency> sums) const;
  std::vector<PhotoConsistency> sums() const;
};

bool is_consistency(std::span<const uint8_t> bytes);
// Encodes the sums of all hypotheses of a request. `small` compresses the sums of a single camera to a sixth of the
// bytes, but takes more time. Throws Error if there is no hypothesis, if there are more than kMaxHypotheses, or if
// their sizes differ.
ByteBuffer encode_consistency(const ConsistencyHeader& header, std::span<const PhotoConsistency> hypotheses,
                              bool small = false);
// Parses the start of a photo-consistency unit, and sets *shape unless it is null. On failure, returns nullopt and sets
// *reason unless it is null.
std::optional<ConsistencyHeader> parse_consistency_header(std::span<const uint8_t> bytes,
                                                          ConsistencyShape* shape = nullptr,
                                                          std::string* reason = nullptr);
// Decodes exactly one photo-consistency unit of the expected shape. On failure, returns nullopt and sets *reason unless
// it is null. Allocates memory only for nodes with data in `bytes`, so a forged size does no harm.
std::optional<ConsistencyUnit> decode_consistency(std::span<const uint8_t> bytes, const ConsistencyShape& expected,
                                                  std::string* reason = nullptr);

}  // namespace lf::wire
