// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <span>

#include <gst/gst.h>

#include "view/request_limits.h"

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

// The limits of an element to what requests may ask of it: its properties max-pixels, max-aperture, max-trials,
// max-requests-per-second and, for elements that serve several views, max-views; what is refused for them is counted,
// and a warning tells of it once a second at most. Thread-safe.
class RequestGuard {
 public:
  enum Property { kMaxPixels, kMaxAperture, kMaxTrials, kMaxRate, kMaxViews, kNumProperties };
  static constexpr const char* kNames[kNumProperties] = {"max-pixels", "max-aperture", "max-trials",
                                                         "max-requests-per-second", "max-views"};
  // Installs the limits as properties first_id, first_id + 1, ... of the class; the last one, max-views, only if
  // `views`.
  static void install(GObjectClass* klass, guint first_id, bool views = true);
  // `first_id`: as install() was told.
  explicit RequestGuard(guint first_id) : first_id_(first_id) {}
  // Sets or reads the limit that is the property of this id; false if the property is another one.
  bool set(guint id, const GValue* value);
  bool get(guint id, GValue* value) const;

  // Whether a request is to be served. `requester` tells views of the same number apart that different senders ask for.
  // `extent`: of the array, metres, 0: not known. `paced`: requests come in real time, so that there may be too many.
  bool admits(GstElement* element, std::span<const uint8_t> request, double extent, bool paced, uint32_t requester = 0);
  // No more requests come from this sender: its views make room for others.
  void forget(uint32_t requester);
  // Whether an answer of so many pixels may be taken; one larger than any request may ask for is refused.
  bool admits_answer(GstElement* element, int width, int height);

  // Sets the numbers of refused requests to 0.
  void clear();
  uint64_t refused() const;
  // Adds refused, and refused-pixels, -aperture, -trials, -rate, -views, -lens.
  void add_stats(GstStructure* stats) const;

 private:
  // Counts a refusal, and says how many there were so far if it is to be told of. `lock`: of mutex_, given back.
  std::optional<uint64_t> refuse(RequestGate::Refusal refusal, uint64_t now, std::unique_lock<std::mutex> lock);

  const guint first_id_;
  mutable std::mutex mutex_;
  RequestLimits limits_;
  RequestGate gate_;
  uint64_t refused_[RequestGate::kNumRefusals] = {};
  SecondlyMessage told_;
};

}  // namespace lf
