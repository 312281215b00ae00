// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include "common/buffer_ptr.h"

// The video that is accepted behind the compositor of a view: fields LF_VIEW_ID_FIELD (uint) and "caps" (GstCaps).
// lfviewrequest asks for it with a custom query, downstream, before its first request. The compositor tells it with a
// custom event, upstream, when it may have changed. The event is taken if the next requests are for such pictures.
#define LF_PICTURE_CAPS "lightfield-picture-caps"

namespace lf {

// The answer of the view's compositor, downstream of this source pad. Null if there is no such compositor.
SharedCaps query_picture_caps(GstPad* src, guint view_id);
// Whether the query is one, and for which view.
bool is_picture_caps_query(GstQuery* query, guint* view_id);
void answer_picture_caps_query(GstQuery* query, GstCaps* caps);

// A new event, owned by the caller.
GstEvent* picture_caps_event(guint view_id, GstCaps* caps);
// Null if the event is another one.
SharedCaps parse_picture_caps(GstEvent* event, guint* view_id);

}  // namespace lf
