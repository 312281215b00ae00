// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstpushsrc.h>
#include <gst/gst.h>

G_BEGIN_DECLS

#define LF_TYPE_VIEW_REQUEST (lf_view_request_get_type())
G_DECLARE_FINAL_TYPE(LfViewRequest, lf_view_request, LF, VIEW_REQUEST, GstPushSrc)

// Whether requests are answered in this process, as a bin knows that has the cameras: such requests are not compressed,
// and their quality is 0. Any thread.
void lf_view_request_set_in_process(LfViewRequest* self, gboolean in_process);

GST_ELEMENT_REGISTER_DECLARE(lfviewrequest)

G_END_DECLS
