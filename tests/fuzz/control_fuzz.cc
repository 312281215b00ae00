// SPDX-License-Identifier: LGPL-2.1-or-later
// Messages of the data channel: an event or a reason, never both, and nothing in it but numbers that are.
#include <cmath>

#include "fuzz/fuzz.h"
#include "fuzz/gst_start.h"
#include "serve/control_message.h"

LF_FUZZ_TARGET(control)(const uint8_t* data, size_t size) {
  using namespace lf;
  const auto message = serve::parse_control_message({reinterpret_cast<const char*>(data), size}, 0.5);
  fuzz::require(!message.event || message.error.empty());
  fuzz::require(!message.event || message.id);
  if (!message.event) return 0;
  fuzz::require(gst_event_type_get_flags(GST_EVENT_TYPE(message.event.get())) & GST_EVENT_TYPE_UPSTREAM);
  const GstStructure* structure = gst_event_get_structure(message.event.get());
  for (int i = 0; i < gst_structure_n_fields(structure); i++) {
    const GValue* value = gst_structure_get_value(structure, gst_structure_nth_field_name(structure, i));
    fuzz::require(!G_VALUE_HOLDS_DOUBLE(value) || std::isfinite(g_value_get_double(value)));
  }
  serve::control_response(*message.id, message.error);
  return 0;
}
