// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/out_of_service_event.h"

#include <algorithm>

namespace lf {

GstStructure* out_of_service_structure(guint view_id, const CameraSet& cameras) {
  GValue array = G_VALUE_INIT, value = G_VALUE_INIT;
  g_value_init(&array, GST_TYPE_ARRAY);
  g_value_init(&value, G_TYPE_UINT);
  for (const CameraIndex camera : cameras) {
    g_value_set_uint(&value, camera);
    gst_value_array_append_value(&array, &value);
  }
  g_value_unset(&value);
  GstStructure* structure = gst_structure_new(LF_OUT_OF_SERVICE_EVENT, "lf-view-id", G_TYPE_UINT, view_id, nullptr);
  gst_structure_take_value(structure, "cameras", &array);
  return structure;
}

bool parse_out_of_service(GstEvent* event, guint* view_id, CameraSet* cameras) {
  const GstStructure* structure = gst_event_get_structure(event);
  if (GST_EVENT_TYPE(event) != GST_EVENT_CUSTOM_UPSTREAM || !structure ||
      !gst_structure_has_name(structure, LF_OUT_OF_SERVICE_EVENT))
    return false;
  const GValue* array = gst_structure_get_value(structure, "cameras");
  if (!gst_structure_get_uint(structure, "lf-view-id", view_id) || !array || !GST_VALUE_HOLDS_ARRAY(array))
    return false;
  cameras->clear();
  for (guint i = 0; i < gst_value_array_get_size(array); i++) {
    const GValue* value = gst_value_array_get_value(array, i);
    if (G_VALUE_HOLDS_UINT(value) && g_value_get_uint(value) < kMaxCameras) cameras->push_back(g_value_get_uint(value));
  }
  std::ranges::sort(*cameras);
  cameras->erase(std::unique(cameras->begin(), cameras->end()), cameras->end());
  return true;
}

}  // namespace lf
