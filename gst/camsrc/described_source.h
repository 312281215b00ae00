// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <string>

namespace lf {

// The elements that a rig describes (rig/bin_description.h), as a bin with one source pad, "src", which is not linked;
// floating. Caps may stand at the end of the line, too. Throws Error that says what is wrong with it.
GstElement* make_described_source(const std::string& line);

}  // namespace lf
