// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <lightfield/error.h>

#include "base/error.h"

namespace lf::api {

// What f() returns. An Error of the library's inside leaves as one of the public API.
template <typename F>
auto translated(F f) -> decltype(f()) {
  try {
    return f();
  } catch (const Error& error) {
    throw lightfield::Error(error.what());
  }
}

}  // namespace lf::api
