// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

// Initialises GStreamer before the first input; criticals abort the run.
namespace lf::fuzz {

// The first element that uses a structure name registers the name.
inline void start_gst() {
  gst_init(nullptr, nullptr);
  for (const char* name : {"x", "focus-distance"}) g_quark_from_string(name);
  g_log_set_always_fatal(GLogLevelFlags(G_LOG_LEVEL_CRITICAL | G_LOG_FATAL_MASK));
}

}  // namespace lf::fuzz

#ifdef LF_FUZZER
#include <sanitizer/lsan_interface.h>

#include <string>

// Null without sanitizers.
extern "C" __attribute__((weak)) void __lsan_disable();
extern "C" __attribute__((weak)) void __lsan_enable();

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  if (__lsan_disable) __lsan_disable();  // GLib and GStreamer never free their initial allocations
  lf::fuzz::start_gst();
  // GLib leaks its table of quark names when it is full. This leaves room in the table.
  for (int i = 0; g_quark_from_string(std::to_string(i).c_str()) % 2048 != 0; i++) {
  }
  if (__lsan_enable) __lsan_enable();
  return 0;
}
#endif
