// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/frame_timing.h"

#include "view/view_request.h"

namespace lf {

std::optional<SkewMonitor::Report> SkewMonitor::see(std::span<const Frame> frames) {
  Report report;
  for (const Frame& frame : frames) {
    if (frame.period == 0) continue;
    const uint64_t skew = time_between(frame.taken, frame.wanted);
    const bool off = skew > frame.period + frame.period / 4;  // margin for jitter and slightly different frame rates
    State& state = states_[frame.camera];
    state.against = off == state.off ? 0 : state.against + 1;
    if (state.against < kRequests) continue;
    state = {.off = off};
    if (!off) continue;
    report.cameras.push_back(frame.camera);
    if (skew > report.skew) {
      report.skew = skew;
      report.period = frame.period;
      report.is_late = frame.taken < frame.wanted;
      report.behind = frame.behind;
    }
  }
  if (report.cameras.empty()) return std::nullopt;
  return report;
}

}  // namespace lf
