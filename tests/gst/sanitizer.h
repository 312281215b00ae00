// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

namespace lf::test {

// Whether this is a build with a sanitizer that keeps what was freed resident, so that memory seems to grow.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kKeepsFreedMemory = true;
#else
inline constexpr bool kKeepsFreedMemory = false;
#endif

}  // namespace lf::test
