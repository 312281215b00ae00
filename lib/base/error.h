// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <lightfield/error.h>

namespace lf {

// Thrown by everything that reads or validates a file or a user's option. The text names the file and the place
// inside it ("rig.json: cameras[3].params[0]: must be finite") and is fit to be shown to a person as it is.
// What comes off a network never throws: the codecs in wire/ return a std::optional and a reason.
using lightfield::Error;

}  // namespace lf
