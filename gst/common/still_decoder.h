// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

namespace lf {

// Checks whether GStreamer can decode a still image in a format other than PNG and JPEG. Returns "" if a decoder is
// installed, and otherwise the reason for the user, for example that the file is not an image or needs a TIFF decoder.
// `lf-rig check` and lfcamsrc both use this function, so their results agree. Call gst_init() first.
std::string still_decoding_problem(const std::string& path);

}  // namespace lf
