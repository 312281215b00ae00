// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <gst/gst.h>

#include "view/view_request.h"

namespace lf {

// Decides which messages leave: at most one a second. Not thread-safe.
class SecondlyMessage {
 public:
  bool may_leave(uint64_t now_ns) {
    constexpr uint64_t kSecond = 1'000'000'000;
    if (last_ != 0 && now_ns < last_ + kSecond) return false;
    last_ = now_ns;
    return true;
  }

 private:
  uint64_t last_ = 0;
};

// The value of the property `limits`: a structure with the fields max-pixels (uint64), max-aperture (double),
// max-trials, max-requests-per-second and max-views (uint). The caller owns it.
GstStructure* limits_structure(const RequestLimits& limits);
// Reads such a structure, or null. Numbers may have any type. Missing and wrong fields keep their defaults. For each
// wrong or unknown field, adds a text to `problems` that begins with the name of the field.
RequestLimits parse_limits(const GstStructure* structure, std::vector<std::string>& problems);

// Checks requests against the property `limits` of an element. Counts refused requests, and posts a warning about them
// at most once a second. Thread-safe.
class RequestGuard {
 public:
  static constexpr guint kLimits = 100;  // id of the property; other properties of the class have lower ones
  static void install(GObjectClass* klass);
  // Sets or reads the limits; false if the id belongs to another property. Posts warnings about wrong values, at once
  // if the element is running, otherwise when it starts.
  bool set(GstElement* element, guint id, const GValue* value);
  bool get(guint id, GValue* value) const;

  // Whether a request is to be served. `requester` tells views of the same number apart that different senders ask for.
  // `extent`: of the array, metres, 0: not known. `paced`: requests come in real time, so that there may be too many.
  bool admits(GstElement* element, std::span<const uint8_t> request, double extent, bool paced, uint32_t requester = 0);
  // No more requests come from this sender: its views make room for others.
  void forget(uint32_t requester);
  // Whether an answer of so many pixels may be taken; one larger than any request may ask for is refused.
  bool admits_answer(GstElement* element, int width, int height);

  // The element starts: sets the numbers of refused requests to 0.
  void start(GstElement* element);
  uint64_t refused() const;
  // Adds refused, and refused-pixels, -aperture, -trials, -rate, -views, -lens.
  void add_stats(GstStructure* stats) const;

 private:
  void warn_of_problems(GstElement* element) const;
  // Counts a refusal, and says how many there were so far if it is to be told of. `lock`: of mutex_, given back.
  std::optional<uint64_t> refuse(RequestGate::Refusal refusal, uint64_t now, std::unique_lock<std::mutex> lock);

  mutable std::mutex mutex_;
  RequestLimits limits_;
  std::vector<std::string> problems_;  // of what the limits were set to
  RequestGate gate_;
  uint64_t refused_[RequestGate::kNumRefusals] = {};
  SecondlyMessage told_;
};

}  // namespace lf
