// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/view_feedback.h"

#include <algorithm>

#include "common/common.h"
#include "common/gst_wire.h"

namespace lf {
namespace {

constexpr char kCameras[] = "cameras", kExtra[] = "extra", kRequest[] = "request", kSequence[] = "sequence",
               kOtherPlane[] = "other-plane", kWaits[] = "waits";

// Appends to a new array of `type` what `fill` makes of each item, and gives it to the structure.
template <typename Items, typename Fill>
void set_array(GstStructure* structure, const char* field, GType type, const Items& items, const Fill& fill) {
  GValue array = G_VALUE_INIT, value = G_VALUE_INIT;
  g_value_init(&array, GST_TYPE_ARRAY);
  g_value_init(&value, type);
  for (const auto& item : items) {
    fill(&value, item);
    gst_value_array_append_value(&array, &value);
  }
  g_value_unset(&value);
  gst_structure_take_value(structure, field, &array);
}

// Calls take(value) for each element of the array that is of `type`. False if there is no such array.
template <typename Take>
bool each_of_array(const GstStructure* structure, const char* field, GType type, const Take& take) {
  const GValue* array = gst_structure_get_value(structure, field);
  if (!array || !GST_VALUE_HOLDS_ARRAY(array)) return false;
  for (guint i = 0; i < gst_value_array_get_size(array); i++) {
    const GValue* value = gst_value_array_get_value(array, i);
    if (G_VALUE_HOLDS(value, type)) take(value);
  }
  return true;
}

void set_focus(GstStructure* structure, guint view_id, const FoundFocus& focus) {
  ViewRequest next;
  next.view_id = view_id;
  next.sequence = focus.sequence;
  next.view = focus.plan.view;
  next.trials = focus.plan.trials;
  next.on_plane = focus.plan.on_plane;
  next.gains = focus.gains;
  if (focus.plan.plane) next.view.focus.plane = *focus.plan.plane;
  GstBuffer* buffer = encode_request_buffer(next);
  gst_structure_set(structure, kSequence, G_TYPE_UINT, focus.sequence, kRequest, GST_TYPE_BUFFER, buffer, kOtherPlane,
                    G_TYPE_BOOLEAN, focus.plan.plane.has_value(), nullptr);
  gst_buffer_unref(buffer);
}

std::optional<FoundFocus> get_focus(const GstStructure* structure) {
  FoundFocus focus;
  g_autoptr(GstBuffer) buffer = nullptr;
  gboolean other_plane = FALSE;
  if (!gst_structure_get(structure, kSequence, G_TYPE_UINT, &focus.sequence, kRequest, GST_TYPE_BUFFER, &buffer,
                         kOtherPlane, G_TYPE_BOOLEAN, &other_plane, nullptr))
    return {};
  std::optional<ViewRequest> request = decode_request_buffer(buffer);
  if (!request) return {};
  focus.plan = {.trials = std::move(request->trials), .on_plane = request->on_plane};
  if (other_plane) focus.plan.plane = request->view.focus.plane;
  focus.plan.view = std::move(request->view);
  focus.gains = std::move(request->gains);
  return focus;
}

}  // namespace

void set_cameras(GstStructure* structure, const char* field, const CameraSet& cameras) {
  set_array(structure, field, G_TYPE_UINT, cameras,
            [](GValue* value, CameraIndex camera) { g_value_set_uint(value, camera); });
}

GstEvent* view_feedback_event(const ViewFeedback& feedback) {
  GstStructure* structure =
      gst_structure_new(LF_VIEW_FEEDBACK_EVENT, LF_VIEW_ID_FIELD, G_TYPE_UINT, feedback.view_id, nullptr);
  if (feedback.focus) set_focus(structure, feedback.view_id, *feedback.focus);
  if (feedback.out_of_service) set_cameras(structure, kCameras, *feedback.out_of_service);
  if (!feedback.extra_requests.empty())
    set_array(structure, kExtra, GST_TYPE_BUFFER, feedback.extra_requests, [](GValue* value, const ViewRequest& extra) {
      gst_value_take_buffer(value, encode_request_buffer(extra));
    });
  return gst_event_new_custom(GST_EVENT_CUSTOM_UPSTREAM, structure);
}

std::optional<ViewFeedback> parse_view_feedback(GstEvent* event) {
  if (GST_EVENT_TYPE(event) != GST_EVENT_CUSTOM_UPSTREAM || !gst_event_has_name(event, LF_VIEW_FEEDBACK_EVENT))
    return {};
  const GstStructure* structure = gst_event_get_structure(event);
  ViewFeedback feedback;
  if (!gst_structure_get_uint(structure, LF_VIEW_ID_FIELD, &feedback.view_id)) return {};
  feedback.focus = get_focus(structure);
  CameraSet cameras;
  const auto add_camera = [&](const GValue* value) {
    if (g_value_get_uint(value) < kMaxCameras) cameras.push_back(g_value_get_uint(value));
  };
  if (each_of_array(structure, kCameras, G_TYPE_UINT, add_camera)) {
    std::ranges::sort(cameras);
    cameras.erase(std::unique(cameras.begin(), cameras.end()), cameras.end());
    feedback.out_of_service = std::move(cameras);
  }
  each_of_array(structure, kExtra, GST_TYPE_BUFFER, [&](const GValue* value) {
    if (std::optional<ViewRequest> request = decode_request_buffer(gst_value_get_buffer(value)))
      feedback.extra_requests.push_back(std::move(*request));
  });
  return feedback;
}

bool is_focus_found(GstPad* src, guint view_id, bool* waits) {
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
