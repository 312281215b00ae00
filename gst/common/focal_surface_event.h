// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include "focus/focus_control.h"

// Custom upstream event from a compositor's request pad: on which focal surface the next request of the view is
// focused, and what is tried for it. Fields "lf-view-id" (uint), "sequence" (uint: the request that it is told from),
// "request" (GstBuffer: a view request with the surface, the view it was found for, and the trials) and "other-plane"
// (boolean: the plane of that request is to be shown in place of the viewer's).
#define LF_FOCAL_SURFACE_EVENT "lightfield-focal-surface"
// Custom query, downstream: whether a compositor of the view (field "lf-view-id", uint) will send such events.
#define LF_FOCAL_SURFACE_QUERY "lightfield-finds-focus"

namespace lf {

// A new event, owned by the caller. `request`: the one that it is told from, with the gains of the next.
GstEvent* focal_surface_event(const ViewRequest& request, const FocusControl::Plan& plan);
bool is_focal_surface(GstEvent* event);
// What such an event says; false if it is another one, or damaged.
struct FocalSurfaceNews {
  guint view_id = 0, sequence = 0;
  FocusControl::Plan plan;
  GainRequest gains;
};
bool parse_focal_surface(GstEvent* event, FocalSurfaceNews* news);

// Whether somebody downstream of this source pad finds the focus of the view. *waits (may be null): whether who does is
// waiting for its own downstream, as in a pipeline that is paused, and can't get on until that lets it.
bool is_focus_found(GstPad* src, guint view_id, bool* waits = nullptr);
// The other side's answer to that.
void set_focus_waits(GstQuery* query, bool waits);
// Whether the query asks that, and of which view.
bool is_focus_query(GstQuery* query, guint* view_id);

}  // namespace lf
