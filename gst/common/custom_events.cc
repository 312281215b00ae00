// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/custom_events.h"

#include <algorithm>
#include <memory>
#include <new>
#include <utility>

#include <gst/gl/gl.h>

#include "common/common.h"

namespace lf {
namespace {

constexpr char kContext[] = "context", kPictureCaps[] = "caps", kFeedback[] = "feedback", kWaits[] = "waits";

using SharedFeedback = std::shared_ptr<const ViewFeedback>;

// The boxed type of SharedFeedback. Copies are allocated by GLib, because GStreamer copies the boxes in C code, where
// exceptions are not allowed.
GType feedback_type() {
  static const GType type = [] {
    constexpr char kName[] = "LfViewFeedback";
    // The type may exist already, because a process may contain this code twice: in the plugin and in a static library.
    if (const GType known = g_type_from_name(kName)) return known;
    return g_boxed_type_register_static(
        kName,
        [](gpointer box) -> gpointer {
          return new (g_new(SharedFeedback, 1)) SharedFeedback(*static_cast<const SharedFeedback*>(box));
        },
        [](gpointer box) {
          std::destroy_at(static_cast<SharedFeedback*>(box));
          g_free(box);
        });
  }();
  return type;
}

// Returns the structure of an event of our own with this name. Returns null for other events.
const GstStructure* structure_of(GstEvent* event, const char* name) {
  const bool is_it = GST_EVENT_TYPE(event) == GST_EVENT_CUSTOM_UPSTREAM && gst_event_has_name(event, name);
  return is_it ? gst_event_get_structure(event) : nullptr;
}

const GstStructure* structure_of(GstQuery* query, const char* name) {
  const GstStructure* structure = GST_QUERY_TYPE(query) == GST_QUERY_CUSTOM ? gst_query_get_structure(query) : nullptr;
  return structure && gst_structure_has_name(structure, name) ? structure : nullptr;
}

GstEvent* upstream_event(GstStructure* structure) { return gst_event_new_custom(GST_EVENT_CUSTOM_UPSTREAM, structure); }

GstQuery* view_query(const char* name, guint view_id) {
  return gst_query_new_custom(GST_QUERY_CUSTOM,
                              gst_structure_new(name, LF_VIEW_ID_FIELD, G_TYPE_UINT, view_id, nullptr));
}

}  // namespace

GstEvent* hold_event(bool held, guint32 seqnum) {
  GstEvent* event = upstream_event(gst_structure_new(LF_HOLD_EVENT, "held", G_TYPE_BOOLEAN, held, nullptr));
  gst_event_set_seqnum(event, seqnum);
  return event;
}

bool parse_hold(GstEvent* event, bool* held) {
  const GstStructure* structure = structure_of(event, LF_HOLD_EVENT);
  gboolean value = FALSE;
  const bool has = structure && gst_structure_get_boolean(structure, "held", &value);
  *held = value;
  return has;
}

GstEvent* capture_delay_event(GstClockTime delay) {
  return upstream_event(gst_structure_new(LF_CAPTURE_DELAY_EVENT, "delay", G_TYPE_UINT64, delay, nullptr));
}

bool parse_capture_delay(GstEvent* event, GstClockTime* delay) {
  const GstStructure* structure = structure_of(event, LF_CAPTURE_DELAY_EVENT);
  return structure && gst_structure_get_uint64(structure, "delay", delay);
}

bool AutoCaptureDelay::take(GstClockTime needed, GstClockTime now) {
  constexpr GstClockTime kHeadroom = 2 * GST_MSECOND;
  constexpr GstClockTime kSlack = 10 * GST_MSECOND;  // minimum decrease that justifies a new latency
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

std::optional<uint32_t> QosTracker::view_of(GstEvent* event) {
  const GstStructure* structure = GST_EVENT_TYPE(event) == GST_EVENT_QOS ? gst_event_get_structure(event) : nullptr;
  guint view_id = 0;
  if (!structure || !gst_structure_get_uint(structure, LF_VIEW_ID_FIELD, &view_id)) return std::nullopt;
  return view_id;
}

GstEvent* QosTracker::set_view_id(GstEvent* event, uint32_t view_id) {
  event = gst_event_make_writable(event);
  gst_structure_set(gst_event_writable_structure(event), LF_VIEW_ID_FIELD, G_TYPE_UINT, view_id, nullptr);
  return event;
}

void QosTracker::see(GstEvent* event, bool live) {
  constexpr size_t kMaxViews = 1024;  // maximum; further views replace the view that was silent longest
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
  // If not live, only processing time delays the picture, so the next picture is late by the same amount again.
  if (diff > 0 && !live && type != GST_QOS_TYPE_THROTTLE) diff *= 2;
  const bool before_zero = diff < 0 && timestamp < static_cast<GstClockTime>(-diff);
  if (views_.size() >= kMaxViews && !views_.contains(*view_id))
    views_.erase(std::ranges::min_element(views_, {}, [](const auto& entry) { return entry.second.earliest; }));
  views_[*view_id] = {before_zero ? 0 : timestamp + static_cast<GstClockTime>(diff), proportion};
}

std::optional<QosTracker::Late> QosTracker::late(uint32_t view_id, GstClockTime running_time) const {
  const std::lock_guard lock(mutex_);
  const auto view = views_.find(view_id);
  if (view == views_.end() || !GST_CLOCK_TIME_IS_VALID(running_time) || running_time >= view->second.earliest)
    return std::nullopt;
  return Late{GST_CLOCK_DIFF(running_time, view->second.earliest), view->second.proportion};
}

void QosTracker::clear() {
  const std::lock_guard lock(mutex_);
  views_.clear();
}

bool is_in_process_query(GstQuery* query) { return structure_of(query, LF_IN_PROCESS_QUERY) != nullptr; }

void answer_in_process_query(GstQuery* query, GstGLContext* context) {
  if (context) gst_structure_set(gst_query_writable_structure(query), kContext, GST_TYPE_GL_CONTEXT, context, nullptr);
}

LocalCompositor find_local_compositor(GstPad* src) {
  g_autoptr(GstQuery) query = gst_query_new_custom(GST_QUERY_CUSTOM, gst_structure_new_empty(LF_IN_PROCESS_QUERY));
  LocalCompositor compositor{.is_there = static_cast<bool>(gst_pad_peer_query(src, query)), .context = {}};
  g_autoptr(GstGLContext) context = nullptr;
  if (gst_structure_get(gst_query_get_structure(query), kContext, GST_TYPE_GL_CONTEXT, &context, nullptr) && context) {
    compositor.group = share_group(context);
    compositor.context = WeakGlContext(context);
  }
  return compositor;
}

SharedCaps query_picture_caps(GstPad* src, guint view_id) {
  g_autoptr(GstQuery) query = view_query(LF_PICTURE_CAPS, view_id);
  GstCaps* caps = nullptr;
  if (gst_pad_peer_query(src, query))
    gst_structure_get(gst_query_get_structure(query), kPictureCaps, GST_TYPE_CAPS, &caps, nullptr);
  return share_caps(caps);
}

void answer_picture_caps_query(GstQuery* query, GstCaps* caps) {
  gst_structure_set(gst_query_writable_structure(query), kPictureCaps, GST_TYPE_CAPS, caps, nullptr);
}

GstEvent* picture_caps_event(guint view_id, GstCaps* caps) {
  return upstream_event(gst_structure_new(LF_PICTURE_CAPS, LF_VIEW_ID_FIELD, G_TYPE_UINT, view_id, kPictureCaps,
                                          GST_TYPE_CAPS, caps, nullptr));
}

SharedCaps parse_picture_caps(GstEvent* event, guint* view_id) {
  const GstStructure* structure = structure_of(event, LF_PICTURE_CAPS);
  GstCaps* caps = nullptr;
  if (!structure || !gst_structure_get_uint(structure, LF_VIEW_ID_FIELD, view_id)) return nullptr;
  gst_structure_get(structure, kPictureCaps, GST_TYPE_CAPS, &caps, nullptr);
  return share_caps(caps);
}

GstEvent* view_feedback_event(ViewFeedback feedback) {
  const auto shared = std::make_shared<const ViewFeedback>(std::move(feedback));
  return upstream_event(gst_structure_new(LF_VIEW_FEEDBACK_EVENT, kFeedback, feedback_type(), &shared, nullptr));
}

std::shared_ptr<const ViewFeedback> parse_view_feedback(GstEvent* event) {
  const GstStructure* structure = structure_of(event, LF_VIEW_FEEDBACK_EVENT);
  const GValue* value = structure ? gst_structure_get_value(structure, kFeedback) : nullptr;
  if (!value || !G_VALUE_HOLDS(value, feedback_type())) return nullptr;
  return *static_cast<const SharedFeedback*>(g_value_get_boxed(value));
}

bool finds_focus(GstPad* src, guint view_id, bool* waits) {
  g_autoptr(GstQuery) query = view_query(LF_FOCUS_QUERY, view_id);
  const bool found = gst_pad_peer_query(src, query);
  gboolean waiting = FALSE;
  gst_structure_get_boolean(gst_query_get_structure(query), kWaits, &waiting);
  if (waits) *waits = found && waiting;
  return found;
}

void set_focus_waits(GstQuery* query, bool waits) {
  gst_structure_set(gst_query_writable_structure(query), kWaits, G_TYPE_BOOLEAN, waits, nullptr);
}

std::optional<guint> view_of_query(GstQuery* query, const char* name) {
  const GstStructure* structure = structure_of(query, name);
  guint view_id = 0;
  if (!structure || !gst_structure_get_uint(structure, LF_VIEW_ID_FIELD, &view_id)) return std::nullopt;
  return view_id;
}

}  // namespace lf
