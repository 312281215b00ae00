// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/extra_requests_event.h"

#include "common/gst_wire.h"

namespace lf {

GstEvent* extra_requests_event(guint view_id, const std::vector<ViewRequest>& requests) {
  GValue array = G_VALUE_INIT, value = G_VALUE_INIT;
  g_value_init(&array, GST_TYPE_ARRAY);
  g_value_init(&value, GST_TYPE_BUFFER);
  for (const ViewRequest& request : requests) {
    gst_value_take_buffer(&value, encode_request_buffer(request));
    gst_value_array_append_value(&array, &value);
  }
  g_value_unset(&value);
  GstStructure* structure = gst_structure_new(LF_EXTRA_REQUESTS_EVENT, "lf-view-id", G_TYPE_UINT, view_id, nullptr);
  gst_structure_take_value(structure, "requests", &array);
  return gst_event_new_custom(GST_EVENT_CUSTOM_UPSTREAM, structure);
}

bool is_extra_requests(GstEvent* event) {
  return GST_EVENT_TYPE(event) == GST_EVENT_CUSTOM_UPSTREAM && gst_event_has_name(event, LF_EXTRA_REQUESTS_EVENT);
}

bool parse_extra_requests(GstEvent* event, guint* view_id, std::vector<ViewRequest>* requests) {
  if (!is_extra_requests(event)) return false;
  const GstStructure* structure = gst_event_get_structure(event);
  const GValue* array = gst_structure_get_value(structure, "requests");
  if (!gst_structure_get_uint(structure, "lf-view-id", view_id) || !array || !GST_VALUE_HOLDS_ARRAY(array))
    return false;
  requests->clear();
  for (guint i = 0; i < gst_value_array_get_size(array); i++) {
    const GValue* value = gst_value_array_get_value(array, i);
    if (!GST_VALUE_HOLDS_BUFFER(value)) continue;
    if (std::optional<ViewRequest> request = decode_request_buffer(gst_value_get_buffer(value)))
      requests->push_back(std::move(*request));
  }
  return true;
}

}  // namespace lf
