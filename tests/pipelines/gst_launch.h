// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "support/run_program.h"

// gst-launch-1.0 with this build's plugin.
namespace lf::test {

// Runs `environment gst-launch-1.0 options line`; the exit status is 124 after the time limit. `line` is written as in
// a shell.
inline Outcome gst_launch(const std::string& line, const std::string& options = "-q",
                          const std::string& environment = "", int seconds = 60) {
  return run_shell("GST_PLUGIN_PATH=" LF_PLUGIN_DIR " GST_REGISTRY=" LF_PLUGIN_DIR "/test-registry.bin " + environment +
                   " timeout -k 5 " + std::to_string(seconds) + " gst-launch-1.0 " + options + " " + line +
                   " </dev/null");
}

// Runs a launch line that must succeed.
inline void expect_runs(const std::string& line, const std::source_location& where = std::source_location::current()) {
  expect_outcome(gst_launch(line), 0, testing::_, where);
}

}  // namespace lf::test
