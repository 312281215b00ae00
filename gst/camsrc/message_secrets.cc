// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/message_secrets.h"

#include <string>

#include "rig/location_text.h"

namespace lf {
namespace {

bool has_secret(const gchar* text) { return text && location_text(text) != text; }

gboolean find_secret(GQuark /*field*/, const GValue* value, gpointer data) {
  bool& found = *static_cast<bool*>(data);
  if (G_VALUE_HOLDS_STRING(value))
    found = found || has_secret(g_value_get_string(value));
  else if (G_VALUE_HOLDS(value, G_TYPE_ERROR) && g_value_get_boxed(value))
    found = found || has_secret(static_cast<const GError*>(g_value_get_boxed(value))->message);
  else if (GST_VALUE_HOLDS_STRUCTURE(value) && gst_value_get_structure(value))
    gst_structure_foreach(gst_value_get_structure(value), find_secret, data);
  return !found;
}

gboolean hide_secret(GQuark /*field*/, GValue* value, gpointer /*unused*/) {
  if (G_VALUE_HOLDS_STRING(value) && g_value_get_string(value)) {
    g_value_set_string(value, location_text(g_value_get_string(value)).c_str());
  } else if (G_VALUE_HOLDS(value, G_TYPE_ERROR) && g_value_get_boxed(value)) {
    const auto* error = static_cast<const GError*>(g_value_get_boxed(value));
    g_value_take_boxed(value, g_error_new_literal(error->domain, error->code, location_text(error->message).c_str()));
  } else if (GST_VALUE_HOLDS_STRUCTURE(value) && gst_value_get_structure(value)) {
    GstStructure* copy = gst_structure_copy(gst_value_get_structure(value));
    gst_structure_map_in_place(copy, hide_secret, nullptr);
    g_value_take_boxed(value, copy);
  }
  return TRUE;
}

}  // namespace

GstMessage* hide_secrets(GstMessage* message) {
  const GstStructure* structure = gst_message_get_structure(message);
  // souphttpsrc: the password in Base64, and cookies.
  if (structure && gst_structure_has_name(structure, "http-headers")) {
    message = gst_message_make_writable(message);
    gst_structure_remove_all_fields(gst_message_writable_structure(message));
    return message;
  }
  bool found = false;
  if (structure) gst_structure_foreach(structure, find_secret, &found);
  if (!found) return message;
  message = gst_message_make_writable(message);
  gst_structure_map_in_place(gst_message_writable_structure(message), hide_secret, nullptr);
  return message;
}

}  // namespace lf
