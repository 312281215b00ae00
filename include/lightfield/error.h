// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <stdexcept>

namespace lightfield {

// Thrown by every function of this library that is given what it cannot use. The text names the argument, or the file
// and the place in it ("rig.json: cameras[3].params[0]: must be a finite number"), and is fit to be shown to a person.
// An object whose method has thrown can be used as before. Compositor::add(), which is given all that comes off a
// network, does not throw for what it cannot use but says it in its result.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace lightfield
