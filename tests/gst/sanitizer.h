// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

namespace lf::test {

// Whether this is a build with a sanitizer that keeps what was freed resident, so that memory seems to grow, and is so
// slow that live cameras may fall behind and say so.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kKeepsFreedMemory = true, kFallsBehind = true;
#else
inline constexpr bool kKeepsFreedMemory = false, kFallsBehind = false;
#endif

}  // namespace lf::test
