// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

// The version of these headers. `#if LIGHTFIELD_VERSION_AT_LEAST(0, 2, 0)` selects code for version 0.2.0 or later.
#define LIGHTFIELD_VERSION_MAJOR 0
#define LIGHTFIELD_VERSION_MINOR 1
#define LIGHTFIELD_VERSION_PATCH 0
#define LIGHTFIELD_VERSION_AT_LEAST(major, minor, patch)                                              \
  (LIGHTFIELD_VERSION_MAJOR * 1000000 + LIGHTFIELD_VERSION_MINOR * 1000 + LIGHTFIELD_VERSION_PATCH >= \
   (major)*1000000 + (minor)*1000 + (patch))

namespace lightfield {

// Returns the version of the library that the program has loaded, such as "0.1.0". This version can be newer than the
// version of the headers.
//
// Binary compatibility: a program works with every library that has the same soname (liblightfield.so.0) and is not
// older than the headers of the program. Such libraries keep all functions, the layout of all structs, and the values
// of all enumerators. New options use the reserved space of the option structs, where 0 means the behaviour without the
// option. An incompatible library has another soname. The interface contains types of the C++ standard library, so both
// must use the same implementation (on Linux, usually libstdc++ with its current ABI).
const char* version();

}  // namespace lightfield
