// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

// For targets that need GStreamer: it is there before the first input, and its criticals end the run.
namespace lf::fuzz {

// The names that structures may have are known to a process once an element has asked for them.
inline void start_gst() {
  gst_init(nullptr, nullptr);
  for (const char* name : {"x", "focus-distance"}) g_quark_from_string(name);
  g_log_set_always_fatal(GLogLevelFlags(G_LOG_LEVEL_CRITICAL | G_LOG_FATAL_MASK));
}

}  // namespace lf::fuzz

#ifdef LF_FUZZER
#include <sanitizer/lsan_interface.h>

#include <string>

// Absent where runs are without sanitizers.
extern "C" __attribute__((weak)) void __lsan_disable();
extern "C" __attribute__((weak)) void __lsan_enable();

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  if (__lsan_disable) __lsan_disable();  // GLib and GStreamer never free what they begin with
  lf::fuzz::start_gst();
  // When its table of names is full GLib leaves it behind. Now it has room.
  for (int i = 0; g_quark_from_string(std::to_string(i).c_str()) % 2048 != 0; i++) {
  }
  if (__lsan_enable) __lsan_enable();
  return 0;
}
#endif
