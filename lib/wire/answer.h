// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "render/sum_planes.h"
#include "rig/camera_ranges.h"
#include "view/view_request.h"

namespace lf::wire {

// What one node has to give for one request of one view: one buffer, application/x-lightfield-answer, or several parts
// of it, each a unit of its own; see spec.md.

struct AnswerHeader {
  uint32_t view_id = 0;
  uint32_t sequence = 0;
  int view_width = 0, view_height = 0;      // pixels
  PixelFamily family = PixelFamily::kNone;  // the family of all fragments; kNone: the node has no camera image yet
  uint64_t target_time = kNoTime;           // the request's, nanoseconds
  uint64_t actual_time = kNoTime;           // capture time of the frame farthest from the target; same clock
  uint64_t rig_hash = 0;
  uint32_t node = 0;
  bool last_of_node = true;  // nothing more comes from this node for this request
  CameraRanges cameras;  // cameras whose contributions to the view are in the answer, or are nothing; empty: not told
  CameraRanges blind;    // those of `cameras` that have no picture: in a sum, lost weight stands in its place
  bool operator==(const AnswerHeader&) const = default;
};

// The beginning of an answer to this request, for a view of this width and height, of this rig.
inline AnswerHeader answer_to(const RequestHeader& request, std::pair<int, int> view_size, uint64_t rig_hash) {
  return {.view_id = request.view_id,
          .sequence = request.sequence,
          .view_width = view_size.first,
          .view_height = view_size.second,
          .target_time = request.target_time,
          .rig_hash = rig_hash};
}

// The part of an answer that is in a unit: `count` of its `total` fragments, from number `first` on.
struct AnswerPart {
  uint32_t first = 0, count = 0, total = 0;
  bool whole() const { return count == total; }
  bool operator==(const AnswerPart&) const = default;
};

// All that a unit says in front of its fragments.
struct AnswerPartHeader : AnswerHeader {
  AnswerPart part;
  bool operator==(const AnswerPartHeader&) const = default;
};

enum class Codec : uint8_t {
  kRaw = 0,    // 8 bits, as in Fragment
  kJpeg = 1,   // a scan without tables
  kRaw16 = 2,  // sums in 16 bits, as in SumPlanes
};

// An entry of the fragment table.
struct FragmentHeader {
  // The camera whose pixels these are; nothing: part of the sum of the node's cameras.
  std::optional<CameraIndex> camera;
  PixelFamily family = PixelFamily::kNone;  // the same as the answer's
  Rect rect;                                // inside the view, or the camera's image; kI420: x0, y0 even
  Codec codec = Codec::kRaw;
  uint8_t quality = 0;    // 1 to 100 of JPEG, else 0
  bool has_lost = false;  // a plane of lost weight follows the pixels
  bool operator==(const FragmentHeader&) const = default;
};

// A fragment with its payload, which refers to the bytes of the answer.
struct FragmentView : FragmentHeader {
  std::span<const uint8_t> payload;
};

struct AnswerView : AnswerPartHeader {
  std::vector<FragmentView> fragments;
};

}  // namespace lf::wire
