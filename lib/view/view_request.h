// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "rig/mesh.h"
#include "view/view.h"
#include "view/view_set.h"

namespace lf {

// A focal surface that a request has the cameras compare beside the one in use, of which every machine makes it by the
// same integers (focus/trial_levels.h).
struct Trial {
  enum class Kind : uint8_t {
    kBlurred = 0,  // the surface, smoothed: [1 6 1] / 8 along rows and columns
    kFarther = 1,  // the least level of a node and its eight neighbours, smoothed
    kNearer = 2,   // the largest level of a node and its eight neighbours, smoothed
    kShifted = 3,  // the surface, smoothed, `value` levels nearer
    kPlane = 4,    // the level `value` everywhere
    kFocused = 6,  // the viewer's plane
  };
  Kind kind = Kind::kBlurred;
  int16_t value = 0;  // levels
  bool operator==(const Trial&) const = default;
};

inline constexpr size_t kMaxTrials = 16;  // that one request may ask for

inline constexpr uint64_t kNoTime = UINT64_MAX;

// |a - b|, nanoseconds. Neither may be kNoTime.
inline uint64_t time_between(uint64_t a, uint64_t b) { return a > b ? a - b : b - a; }

// What requests of all kinds begin with: which picture is asked for, and when.
struct RequestHeader {
  uint32_t view_id = 0;
  uint32_t sequence = 0;       // grows by one with each request of the view, and wraps
  uint64_t target_time = 0;    // nanoseconds; capture time wanted, or kNoTime: the newest frame there is
  bool absolute_time = false;  // target_time is clock time (live), else running time from 0 (files)
  bool probe = false;          // the picture is measured, not shown
  bool rehearsal = false;      // no picture is made: only the answers to the trials count
  uint8_t quality = 0;         // how fragments are coded: 0: raw; 1..100: JPEG of this quality is allowed
  uint64_t rig_hash = 0;       // the rig that the view was made for; 0: any
  bool operator==(const RequestHeader&) const = default;
};

// How cameras match their brightness: each compares what it has seen with what all have seen, and divides its images by
// its gain. For requests with a focal map.
struct GainRequest {
  bool use = false;  // cameras divide their images by the gains that they know
  bool ask = false;  // cameras answer with what they see, for the mean: see WideLuma
  // The mean of what all cameras saw (mean_luma()) at the view's request with the sequence number `mean_of`; empty:
  // none.
  std::vector<uint8_t> mean;
  uint32_t mean_of = 0;
  bool operator==(const GainRequest&) const = default;
};

// The whole state of one view: no history is needed to answer it.
struct ViewRequest : RequestHeader {
  View view;
  PlaceInSet place;  // one of a set: the others are asked for beside it, of the same moment
  CameraSet out_of_service;
  bool on_plane = false;  // the picture is drawn through the viewer's plane: the focal map serves the trials alone
  // Surfaces to compare with the focal map, answered with moments; at most kMaxTrials, none without a map.
  std::vector<Trial> trials;
  GainRequest gains;
  bool operator==(const ViewRequest&) const = default;
};

// The view as its picture is drawn.
inline View shown_view(const ViewRequest& request) {
  View view = request.view;
  if (request.on_plane)
    view.focus.map = nullptr;
  else if (view.focus.map && view.focus.map->step > FocalMap::kFinestStep)
    view.focus.map = std::make_shared<FocalMap>(view.focus.map->refined(view.width, view.height));
  return view;
}

}  // namespace lf
