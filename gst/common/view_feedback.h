// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <optional>
#include <vector>

#include "focus/view_focus.h"
#include "rig/mesh.h"
#include "view/view_request.h"

// What a compositor has learnt of its view goes upstream, from its request pad to whoever makes the view's requests, as
// one custom event. Field "lightfield-view-id" (uint), and those of the parts that it has:
//  - a focal surface: "sequence" (uint: the request that it was found from), "request" (GstBuffer: a view request with
//    the surface, the view it was found for, the next trials and gains) and "other-plane" (boolean: the plane of that
//    request is to be shown in place of the viewer's);
//  - cameras out of service: "cameras" (GstValueArray of uint: ascending indices in the rig);
//  - extra requests: "extra" (GstValueArray of GstBuffer: view requests).
#define LF_VIEW_FEEDBACK_EVENT "lightfield-feedback"
// The custom query, downstream, asks whether a compositor of the view (field "lightfield-view-id", uint) will send
// surfaces.
#define LF_FOCUS_QUERY "lightfield-finds-focus"

namespace lf {

struct ViewFeedback {
  guint view_id = 0;
  std::optional<FoundFocus> focus;
  // The cameras that are out of service from the next request on, in place of those that an earlier event named.
  std::optional<CameraSet> out_of_service;
  // Requests that are to be made beside the next one, once. Of each only the view, the cameras out of service, the rig
  // and whether it is a probe count.
  std::vector<ViewRequest> extra_requests;
};

// A new event, owned by the caller.
GstEvent* view_feedback_event(const ViewFeedback& feedback);
// Nothing if the event is another one. Parts of it that can't be read are left out, and so are cameras beyond any rig.
std::optional<ViewFeedback> parse_view_feedback(GstEvent* event);

// A GstValueArray of camera indices, as such an event and the messages of elements have it; takes over nothing.
void set_cameras(GstStructure* structure, const char* field, const CameraSet& cameras);

// Whether somebody downstream of this source pad finds the focus of the view. *waits (may be null): whether who does is
// waiting for its own downstream, as in a pipeline that is paused, and can't get on until that lets it.
bool is_focus_found(GstPad* src, guint view_id, bool* waits = nullptr);
// Writes into the query that a compositor finds the view's focus, and whether it waits for its own downstream.
void set_focus_waits(GstQuery* query, bool waits);
// Whether the query asks for who finds a view's focus, and of which view.
bool is_focus_query(GstQuery* query, guint* view_id);

}  // namespace lf
