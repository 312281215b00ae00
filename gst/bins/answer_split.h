// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

// Gives each answer of a stream to the viewer of its view. Unlike a tee it makes nobody decode what is for others, and
// goes on whatever becomes of one of them: an answer whose viewer does not take it is dropped. Inside of bins alone, so
// it is not registered.
G_BEGIN_DECLS

#define LF_TYPE_ANSWER_SPLIT (lf_answer_split_get_type())
G_DECLARE_FINAL_TYPE(LfAnswerSplit, lf_answer_split, LF, ANSWER_SPLIT, GstElement)

// A new source pad, owned by the element, for the answers of this view; gst_element_release_request_pad() takes it
// away. Thread-safe.
GstPad* lf_answer_split_add_view(LfAnswerSplit* self, guint view_id);

G_END_DECLS
