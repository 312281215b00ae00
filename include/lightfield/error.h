// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <stdexcept>

namespace lightfield {

// Thrown by all functions of this library for invalid input. The text is suitable for users. It names the argument, or
// the file and the place in it ("rig.json: cameras[3].params[0]: must be a finite number").
//
// An object remains usable after one of its methods has thrown. Compositor::add() takes untrusted bytes and reports bad
// input in its result instead of throwing.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace lightfield
