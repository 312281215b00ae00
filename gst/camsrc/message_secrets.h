// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

namespace lf {

// The message with location_text() (rig/location_text.h) of all its texts: errors, warnings, progress and structures of
// the elements that open a camera may name its URI. "http-headers" loses all fields. Takes `message` and returns it, or a copy.
GstMessage* hide_secrets(GstMessage* message);

}  // namespace lf
