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

// Limits messages to one per second: try_acquire() returns true if the last success was at least one second ago. Not
// thread-safe.
class RateLimiter {
 public:
  bool try_acquire(uint64_t now_ns) {
    constexpr uint64_t kSecond = 1'000'000'000;
    if (last_ != 0 && now_ns < last_ + kSecond) return false;
    last_ = now_ns;
    return true;
  }

 private:
  uint64_t last_ = 0;
};

// Returns the value of the property `limits`, owned by the caller: a structure with the fields max-pixels (uint64),
// max-aperture (double), max-hypotheses, max-requests-per-second and max-views (uint).
GstStructure* limits_structure(const RequestLimits& limits);
// Parses the property `limits`; `structure` may be null. Numbers may have any type. Missing and wrong fields keep their
// defaults. Each wrong or unknown field adds a text to `problems` that begins with the field name.
RequestLimits parse_limits(const GstStructure* structure, std::vector<std::string>& problems);

// Protects an element from requests that are too expensive, such as very large views. Requests beyond the property
// `limits` are refused and counted. A warning about them is posted at most once a second. Thread-safe.
class RequestGuard {
 public:
  static constexpr guint kLimits = 100;  // property id; other properties of the class have lower ids
  static void install(GObjectClass* klass);
  // Implement the property `limits` of the element. Both functions return false for the ids of all other properties.
  // Warnings about wrong values are posted at once if the element is running, otherwise when it starts.
  bool set(GstElement* element, guint id, const GValue* value);
  bool get(guint id, GValue* value) const;

  // Returns true if the request is within the limits and may be answered. `request` is the encoded request. `extent` is
  // the size of the array in metres, or 0 if it is unknown. `paced` means that requests arrive in real time; only then
  // their rate is limited. `client` is a number for the sender, because different senders may use the same view ids.
  bool admits(GstElement* element, std::span<const uint8_t> request, double extent, bool paced, uint32_t client = 0);
  // Forgets the views of a sender that has stopped, so that they no longer count towards max-views.
  void forget(uint32_t client);
  // Returns false, and posts a warning, if an answer is larger than any allowed request.
  bool admits_answer(GstElement* element, int width, int height);

  void start(GstElement* element);
  uint64_t refused() const;
  // Adds the fields refused, refused-pixels, -aperture, -hypotheses, -rate, -views and -lens.
  void add_stats(GstStructure* stats) const;

 private:
  void warn_of_problems(GstElement* element) const;
  // Counts a refusal. Returns the total number of refusals if a warning is due, otherwise nothing. `lock` is the lock
  // of mutex_, which is released on return.
  std::optional<uint64_t> refuse(RequestLimiter::Refusal refusal, uint64_t now, std::unique_lock<std::mutex> lock);

  mutable std::mutex mutex_;
  RequestLimits limits_;
  std::vector<std::string> problems_;
  RequestLimiter gate_;
  uint64_t refused_[RequestLimiter::kNumRefusals] = {};
  RateLimiter log_limit_;
};

}  // namespace lf
