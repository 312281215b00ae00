// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <vector>

#include "view/view_request.h"

// Custom upstream event from a compositor's request pad: what its lfviewrequest is to ask for beside the next request
// of the view, once. Fields "lf-view-id" (uint) and "requests" (GstValueArray of GstBuffer: view requests, of which
// view, cameras out of service, rig and whether they are probes count).
#define LF_EXTRA_REQUESTS_EVENT "lightfield-extra-requests"

namespace lf {

// A new event, owned by the caller.
GstEvent* extra_requests_event(guint view_id, const std::vector<ViewRequest>& requests);
bool is_extra_requests(GstEvent* event);
// False if the event is another one. Requests that can't be read are left out.
bool parse_extra_requests(GstEvent* event, guint* view_id, std::vector<ViewRequest>* requests);

}  // namespace lf
