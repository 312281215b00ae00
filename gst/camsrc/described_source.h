// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <string>

namespace lf {

// The elements that a rig describes (rig/bin_description.h), as a bin with one source pad, "src", of the last of them;
// floating. The line may end with caps, or with an element whose pads come by and by. Throws Error that says what is
// wrong with it. Unless the rig is `trusted`, elements that are not on the list of rig/bin_description.h are errors.
GstElement* make_described_source(const std::string& line, bool trusted);

}  // namespace lf
