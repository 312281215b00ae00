// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/capture_delay.h"

#include <algorithm>

namespace lf {
namespace {

constexpr GstClockTime kHeadroom = 2 * GST_MSECOND;  // of what is needed to what is waited for
constexpr GstClockTime kSlack = 10 * GST_MSECOND;    // that is not worth another latency

}  // namespace

GstEvent* capture_delay_event(GstClockTime delay) {
  return gst_event_new_custom(GST_EVENT_CUSTOM_UPSTREAM,
                              gst_structure_new(LF_CAPTURE_DELAY_EVENT, "delay", G_TYPE_UINT64, delay, nullptr));
}

bool parse_capture_delay(GstEvent* event, GstClockTime* delay) {
  return GST_EVENT_TYPE(event) == GST_EVENT_CUSTOM_UPSTREAM && gst_event_has_name(event, LF_CAPTURE_DELAY_EVENT) &&
         gst_structure_get_uint64(gst_event_get_structure(event), "delay", delay);
}

bool AutoCaptureDelay::take(GstClockTime needed, GstClockTime now) {
  const std::lock_guard lock(mutex_);
  needed = std::min(needed, kMost);
  if (since_ == 0) since_ = now;
  while (!reports_.empty() && reports_.back().needed <= needed) reports_.pop_back();
  reports_.push_back({now, needed});
  while (reports_.front().time + kMemory < now) reports_.pop_front();
  const GstClockTime most = reports_.front().needed;
  const GstClockTime wanted = std::min(most + kHeadroom, kMost);
  const bool grows = most > delay_;
  const bool shrinks = now >= since_ + kMemory && wanted + std::max(kSlack, delay_ / 4) < delay_;
  if (grows || shrinks) delay_ = wanted;
  return grows || shrinks;
}

GstClockTime AutoCaptureDelay::delay() const {
  const std::lock_guard lock(mutex_);
  return delay_;
}

void AutoCaptureDelay::clear() {
  const std::lock_guard lock(mutex_);
  reports_.clear();
  since_ = delay_ = 0;
}

}  // namespace lf
