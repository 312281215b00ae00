// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/hold_event.h"

namespace lf {

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

}  // namespace lf
