// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

namespace lf {

// Returns why the elements cannot decode a still image other than PNG and JPEG, such as a TIFF file without an
// installed decoder or a file that is no image. Returns "" for an image with a decoder. `lf-rig check` and lfcamsrc
// both use this function, so that they agree. Needs gst_init().
std::string still_decoding_problem(const std::string& path);

}  // namespace lf
