// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include "rig/mesh.h"

// Custom upstream event from a compositor's request pad: from the next request of the view on, these cameras are out of
// service, and no others because of it. Fields "lf-view-id" (uint) and "cameras" (GstValueArray of uint: ascending
// indices in the rig).
#define LF_OUT_OF_SERVICE_EVENT "lightfield-out-of-service"

namespace lf {

// The event's structure, owned by the caller; the element message of the same name has it, too.
GstStructure* out_of_service_structure(guint view_id, const CameraSet& cameras);
// False if the event is another one. Cameras beyond every rig are left out.
bool parse_out_of_service(GstEvent* event, guint* view_id, CameraSet* cameras);

}  // namespace lf
