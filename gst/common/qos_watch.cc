// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/qos_watch.h"

#include <algorithm>

#include "common/common.h"

namespace lf {
namespace {

constexpr size_t kMostViews = 1024;  // of viewers that come and go; then that of the longest silence is forgotten

}  // namespace

std::optional<uint32_t> QosWatch::view_of(GstEvent* event) {
  const GstStructure* structure = GST_EVENT_TYPE(event) == GST_EVENT_QOS ? gst_event_get_structure(event) : nullptr;
  guint view_id = 0;
  if (!structure || !gst_structure_get_uint(structure, LF_VIEW_ID_FIELD, &view_id)) return std::nullopt;
  return view_id;
}

GstEvent* QosWatch::name_view(GstEvent* event, uint32_t view_id) {
  event = gst_event_make_writable(event);
  gst_structure_set(gst_event_writable_structure(event), LF_VIEW_ID_FIELD, G_TYPE_UINT, view_id, nullptr);
  return event;
}

void QosWatch::see(GstEvent* event, bool live) {
  const std::optional<uint32_t> view_id = view_of(event);
  if (!view_id) return;
  GstQOSType type{};
  gdouble proportion = 1;
  GstClockTimeDiff diff = 0;
  GstClockTime timestamp = GST_CLOCK_TIME_NONE;
  gst_event_parse_qos(event, &type, &proportion, &diff, &timestamp);
  const std::lock_guard lock(mutex_);
  if (!GST_CLOCK_TIME_IS_VALID(timestamp)) {
    views_.erase(*view_id);
    return;
  }
  // Where nothing but the work takes time, what comes next is late by as much again when this has been made up for.
  if (diff > 0 && !live && type != GST_QOS_TYPE_THROTTLE) diff *= 2;
  const bool before_zero = diff < 0 && timestamp < static_cast<GstClockTime>(-diff);
  if (views_.size() >= kMostViews && !views_.contains(*view_id))
    views_.erase(std::ranges::min_element(views_, {}, [](const auto& entry) { return entry.second.earliest; }));
  views_[*view_id] = {before_zero ? 0 : timestamp + static_cast<GstClockTime>(diff), proportion};
}

std::optional<QosWatch::Late> QosWatch::late(uint32_t view_id, GstClockTime running_time) const {
  const std::lock_guard lock(mutex_);
  const auto view = views_.find(view_id);
  if (view == views_.end() || !GST_CLOCK_TIME_IS_VALID(running_time) || running_time >= view->second.earliest)
    return std::nullopt;
  return Late{GST_CLOCK_DIFF(running_time, view->second.earliest), view->second.proportion};
}

void QosWatch::clear() {
  const std::lock_guard lock(mutex_);
  views_.clear();
}

}  // namespace lf
