// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include "common/buffer_ptr.h"

// Custom query, downstream: which video does the element behind the compositor of a view accept? Fields
// LF_VIEW_ID_FIELD (uint) and, in the answer, "caps" (GstCaps).
#define LF_PICTURE_CAPS_QUERY "lightfield-picture-caps"

namespace lf {

// The answer of the view's compositor, downstream of this source pad. Null if there is no such compositor.
SharedCaps query_picture_caps(GstPad* src, guint view_id);
// Whether the query is one, and for which view.
bool is_picture_caps_query(GstQuery* query, guint* view_id);
void answer_picture_caps_query(GstQuery* query, GstCaps* caps);

}  // namespace lf
