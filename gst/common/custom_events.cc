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

}  // namespace

GstEvent* hold_event(bool held, guint32 seqnum) {
  GstStructure* structure = gst_structure_new(LF_HOLD_EVENT, "held", G_TYPE_BOOLEAN, held, nullptr);
  GstEvent* event = gst_event_new_custom(GST_EVENT_CUSTOM_UPSTREAM, structure);
  gst_event_set_seqnum(event, seqnum);
  return event;
}

bool parse_hold(GstEvent* event, bool* held) {
  if (GST_EVENT_TYPE(event) != GST_EVENT_CUSTOM_UPSTREAM || !gst_event_has_name(event, LF_HOLD_EVENT)) return false;
  gboolean value = FALSE;
  const bool has = gst_structure_get_boolean(gst_event_get_structure(event), "held", &value);
  *held = value;
  return has;
}

GstEvent* capture_delay_event(GstClockTime delay) {
  return gst_event_new_custom(GST_EVENT_CUSTOM_UPSTREAM,
                              gst_structure_new(LF_CAPTURE_DELAY_EVENT, "delay", G_TYPE_UINT64, delay, nullptr));
}

bool parse_capture_delay(GstEvent* event, GstClockTime* delay) {
  return GST_EVENT_TYPE(event) == GST_EVENT_CUSTOM_UPSTREAM && gst_event_has_name(event, LF_CAPTURE_DELAY_EVENT) &&
         gst_structure_get_uint64(gst_event_get_structure(event), "delay", delay);
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

bool is_in_process_query(GstQuery* query) {
  const GstStructure* structure = GST_QUERY_TYPE(query) == GST_QUERY_CUSTOM ? gst_query_get_structure(query) : nullptr;
  return structure && gst_structure_has_name(structure, LF_IN_PROCESS_QUERY);
}

void answer_in_process_query(GstQuery* query, GstGLContext* context) {
  if (context) gst_structure_set(gst_query_writable_structure(query), kContext, GST_TYPE_GL_CONTEXT, context, nullptr);
}

LocalCompositor find_local_compositor(GstPad* src) {
  GstQuery* query = gst_query_new_custom(GST_QUERY_CUSTOM, gst_structure_new_empty(LF_IN_PROCESS_QUERY));
  LocalCompositor compositor{.is_there = static_cast<bool>(gst_pad_peer_query(src, query)), .context = {}};
  GstGLContext* context = nullptr;
  if (gst_structure_get(gst_query_get_structure(query), kContext, GST_TYPE_GL_CONTEXT, &context, nullptr) && context) {
    compositor.group = share_group(context);
    compositor.context = WeakGlContext(context);
    gst_object_unref(context);
  }
  gst_query_unref(query);
  return compositor;
}

SharedCaps query_picture_caps(GstPad* src, guint view_id) {
  GstQuery* query = gst_query_new_custom(
      GST_QUERY_CUSTOM, gst_structure_new(LF_PICTURE_CAPS, LF_VIEW_ID_FIELD, G_TYPE_UINT, view_id, nullptr));
  GstCaps* caps = nullptr;
  if (gst_pad_peer_query(src, query))
    gst_structure_get(gst_query_get_structure(query), kPictureCaps, GST_TYPE_CAPS, &caps, nullptr);
  gst_query_unref(query);
  return share_caps(caps);
}

bool is_picture_caps_query(GstQuery* query, guint* view_id) {
  const GstStructure* structure = GST_QUERY_TYPE(query) == GST_QUERY_CUSTOM ? gst_query_get_structure(query) : nullptr;
  return structure && gst_structure_has_name(structure, LF_PICTURE_CAPS) &&
         gst_structure_get_uint(structure, LF_VIEW_ID_FIELD, view_id);
}

void answer_picture_caps_query(GstQuery* query, GstCaps* caps) {
  gst_structure_set(gst_query_writable_structure(query), kPictureCaps, GST_TYPE_CAPS, caps, nullptr);
}

GstEvent* picture_caps_event(guint view_id, GstCaps* caps) {
  return gst_event_new_custom(GST_EVENT_CUSTOM_UPSTREAM,
                              gst_structure_new(LF_PICTURE_CAPS, LF_VIEW_ID_FIELD, G_TYPE_UINT, view_id, kPictureCaps,
                                                GST_TYPE_CAPS, caps, nullptr));
}

SharedCaps parse_picture_caps(GstEvent* event, guint* view_id) {
  if (GST_EVENT_TYPE(event) != GST_EVENT_CUSTOM_UPSTREAM || !gst_event_has_name(event, LF_PICTURE_CAPS)) return nullptr;
  const GstStructure* structure = gst_event_get_structure(event);
  GstCaps* caps = nullptr;
  if (!gst_structure_get_uint(structure, LF_VIEW_ID_FIELD, view_id)) return nullptr;
  gst_structure_get(structure, kPictureCaps, GST_TYPE_CAPS, &caps, nullptr);
  return share_caps(caps);
}

void set_cameras(GstStructure* structure, const char* field, const CameraSet& cameras) {
  GValue array = G_VALUE_INIT, value = G_VALUE_INIT;
  g_value_init(&array, GST_TYPE_ARRAY);
  g_value_init(&value, G_TYPE_UINT);
  for (const CameraIndex camera : cameras) {
    g_value_set_uint(&value, camera);
    gst_value_array_append_value(&array, &value);
  }
  g_value_unset(&value);
  gst_structure_take_value(structure, field, &array);
}

GstEvent* view_feedback_event(ViewFeedback feedback) {
  const auto shared = std::make_shared<const ViewFeedback>(std::move(feedback));
  return gst_event_new_custom(GST_EVENT_CUSTOM_UPSTREAM,
                              gst_structure_new(LF_VIEW_FEEDBACK_EVENT, kFeedback, feedback_type(), &shared, nullptr));
}

std::shared_ptr<const ViewFeedback> parse_view_feedback(GstEvent* event) {
  if (GST_EVENT_TYPE(event) != GST_EVENT_CUSTOM_UPSTREAM || !gst_event_has_name(event, LF_VIEW_FEEDBACK_EVENT))
    return nullptr;
  const GValue* value = gst_structure_get_value(gst_event_get_structure(event), kFeedback);
  if (!value || !G_VALUE_HOLDS(value, feedback_type())) return nullptr;
  return *static_cast<const SharedFeedback*>(g_value_get_boxed(value));
}

bool finds_focus(GstPad* src, guint view_id, bool* waits) {
  GstQuery* query = gst_query_new_custom(
      GST_QUERY_CUSTOM, gst_structure_new(LF_FOCUS_QUERY, LF_VIEW_ID_FIELD, G_TYPE_UINT, view_id, nullptr));
  const bool found = gst_pad_peer_query(src, query);
  gboolean waiting = FALSE;
  gst_structure_get_boolean(gst_query_get_structure(query), kWaits, &waiting);
  if (waits) *waits = found && waiting;
  gst_query_unref(query);
  return found;
}

void set_focus_waits(GstQuery* query, bool waits) {
  gst_structure_set(gst_query_writable_structure(query), kWaits, G_TYPE_BOOLEAN, waits, nullptr);
}

bool is_focus_query(GstQuery* query, guint* view_id) {
  const GstStructure* structure = gst_query_get_structure(query);
  return GST_QUERY_TYPE(query) == GST_QUERY_CUSTOM && structure && gst_structure_has_name(structure, LF_FOCUS_QUERY) &&
         gst_structure_get_uint(structure, LF_VIEW_ID_FIELD, view_id);
}

}  // namespace lf
