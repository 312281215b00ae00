// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <filesystem>
#include <fstream>

#include <malloc.h>
#include <unistd.h>

namespace lf::test {

inline long resident_kib() {
  std::ifstream file("/proc/self/statm");
  long size = 0, pages = 0;
  file >> size >> pages;
  return pages * sysconf(_SC_PAGESIZE) / 1024;
}

inline long allocated_kib() {
  const struct mallinfo2 info = mallinfo2();
  return static_cast<long>((info.uordblks + info.hblkhd) / 1024);
}

// Returns the number of entries in a folder of /proc/self: "fd" (open files) or "task" (threads).
inline ptrdiff_t count_of(const char* folder) {
  const std::filesystem::path path = std::filesystem::path("/proc/self") / folder;
  return std::distance(std::filesystem::directory_iterator(path), std::filesystem::directory_iterator());
}

// True with a sanitizer, which keeps freed memory resident and slows live cameras down.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kKeepsFreedMemory = true, kFallsBehind = true;
#else
inline constexpr bool kKeepsFreedMemory = false, kFallsBehind = false;
#endif

}  // namespace lf::test
