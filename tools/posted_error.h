// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <string>

#include "rig/location_text.h"

namespace lf {

// What the first error says that is on the pipeline's bus, or comes there within `patience`; `otherwise` if none does.
// The message is taken off the bus.
inline std::string posted_error(GstElement* pipeline, GstClockTime patience, std::string otherwise) {
  GstBus* bus = gst_element_get_bus(pipeline);
  if (GstMessage* message = gst_bus_timed_pop_filtered(bus, patience, GST_MESSAGE_ERROR)) {
    GError* error = nullptr;
    gst_message_parse_error(message, &error, nullptr);
    otherwise = location_text(error->message);
    g_error_free(error);
    gst_message_unref(message);
  }
  gst_object_unref(bus);
  return otherwise;
}

}  // namespace lf
