// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

// Gives each answer or request of a stream to the viewer of its view. Unlike a tee it makes nobody decode what is for
// others, and goes on whatever becomes of one of them: a unit whose viewer does not take it is dropped. Inside of bins
// alone, so it is not registered.
G_BEGIN_DECLS

#define LF_TYPE_VIEW_SPLIT (lf_view_split_get_type())
G_DECLARE_FINAL_TYPE(LfViewSplit, lf_view_split, LF, VIEW_SPLIT, GstElement)

// A new source pad, owned by the element, for the units of this view; gst_element_release_request_pad() takes it
// away. Thread-safe.
GstPad* lf_view_split_add_view(LfViewSplit* self, guint view_id);

G_END_DECLS
