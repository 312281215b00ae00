// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/focal_surface_event.h"

#include "common/gst_wire.h"

namespace lf {

static constexpr char kWaits[] = "waits";

GstEvent* focal_surface_event(const ViewRequest& request, const FocusControl::Plan& plan) {
  ViewRequest next = request;
  next.view = plan.view;
  next.trials = plan.trials;
  next.on_plane = plan.on_plane;
  if (plan.plane) next.view.focus.plane = *plan.plane;
  GstBuffer* buffer = encode_request_buffer(next);
  GstStructure* structure = gst_structure_new(LF_FOCAL_SURFACE_EVENT, "lf-view-id", G_TYPE_UINT, request.view_id,
                                              "sequence", G_TYPE_UINT, request.sequence, "request", GST_TYPE_BUFFER,
                                              buffer, "other-plane", G_TYPE_BOOLEAN, plan.plane.has_value(), nullptr);
  gst_buffer_unref(buffer);
  return gst_event_new_custom(GST_EVENT_CUSTOM_UPSTREAM, structure);
}

bool is_focal_surface(GstEvent* event) {
  return GST_EVENT_TYPE(event) == GST_EVENT_CUSTOM_UPSTREAM && gst_event_has_name(event, LF_FOCAL_SURFACE_EVENT);
}

bool parse_focal_surface(GstEvent* event, FocalSurfaceNews* news) {
  if (!is_focal_surface(event)) return false;
  const GstStructure* structure = gst_event_get_structure(event);
  g_autoptr(GstBuffer) buffer = nullptr;
  gboolean other_plane = FALSE;
  if (!gst_structure_get(structure, "lf-view-id", G_TYPE_UINT, &news->view_id, "sequence", G_TYPE_UINT, &news->sequence,
                         "request", GST_TYPE_BUFFER, &buffer, "other-plane", G_TYPE_BOOLEAN, &other_plane, nullptr))
    return false;
  std::optional<ViewRequest> request = decode_request_buffer(buffer);
  if (!request) return false;
  news->plan = {.trials = std::move(request->trials), .on_plane = request->on_plane};
  if (other_plane) news->plan.plane = request->view.focus.plane;
  news->plan.view = std::move(request->view);
  news->gains = std::move(request->gains);
  return true;
}

bool is_focus_found(GstPad* src, guint view_id, bool* waits) {
  GstQuery* query = gst_query_new_custom(
      GST_QUERY_CUSTOM, gst_structure_new(LF_FOCAL_SURFACE_QUERY, "lf-view-id", G_TYPE_UINT, view_id, nullptr));
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
  return GST_QUERY_TYPE(query) == GST_QUERY_CUSTOM && structure &&
         gst_structure_has_name(structure, LF_FOCAL_SURFACE_QUERY) &&
         gst_structure_get_uint(structure, "lf-view-id", view_id);
}

}  // namespace lf
