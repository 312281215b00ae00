// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

// What lfcompositor said about one picture (element message "lightfield-view").
struct ViewLogEntry {
  double clock = 0;  // seconds, when the message was printed
  uint32_t sequence = 0;
  bool complete = false;
  uint64_t bytes = 0, trial_bytes = 0, latency_ns = 0;
};

// Reads what `gst-launch-1.0 -m` printed, each line with the clock in front (seconds: bash's $EPOCHREALTIME); lines
// that are no such message are passed over. Throws lf::Error if the file can't be read or there is not one.
std::vector<ViewLogEntry> read_view_log(const std::string& path);
