// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <stdexcept>

namespace lightfield {

// The exception that all functions of this library throw for invalid input. The text is a message for users. It names
// the argument, or the file and the place in the file, for example "rig.json: cameras[3].params[0]: must be a finite
// number".
//
// An object remains usable after one of its methods has thrown. Compositor::add() never throws for bad input, because
// it takes bytes from the network; it reports the problem in its result.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace lightfield
