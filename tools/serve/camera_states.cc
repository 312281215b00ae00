// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camera_states.h"

namespace lf::serve {
namespace {

// Empty where there is none; owned by the caller.
GstStructure* stats_of(GstElement* element) {
  GstStructure* stats = nullptr;
  g_object_get(element, "stats", &stats, nullptr);
  return stats ? stats : gst_structure_new_empty("lightfield-fragment-stats");
}

const GstStructure* inner(const GstStructure* outer, const char* name) {
  const GValue* value = gst_structure_get_value(outer, name);
  return value && GST_VALUE_HOLDS_STRUCTURE(value) ? gst_value_get_structure(value) : nullptr;
}

}  // namespace

CameraStates camera_states(GstElement* node) {
  CameraStates states;
  g_autoptr(GstStructure) stats = stats_of(node);
  const GstStructure* cameras = inner(stats, "cameras");
  const gint count = cameras ? gst_structure_n_fields(cameras) : 0;
  for (gint i = 0; i < count; i++) {
    const GstStructure* camera = inner(cameras, gst_structure_nth_field_name(cameras, static_cast<guint>(i)));
    if (!camera) continue;
    states.count++;
    states.working += g_strcmp0(gst_structure_get_string(camera, "state"), "lost") != 0;
  }
  return states;
}

std::string camera_problem(GstElement* node, uint32_t id) {
  GstElement* camera = gst_bin_get_by_name(GST_BIN(node), ("camera" + std::to_string(id)).c_str());
  if (!camera) return "";
  g_autoptr(GstStructure) stats = stats_of(camera);
  gst_object_unref(camera);
  const char* reason = gst_structure_get_string(stats, "reason");
  return reason ? reason : "";
}

}  // namespace lf::serve
