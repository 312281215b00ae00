// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace lf::serve {

// What the monitor of an lfcompositor says of the cameras.
struct MonitorReport {
  struct Camera {
    double psnr = 0, gain = 0, shift = 0;  // NaN: not known
    std::string fault;                     // "": none
  };
  uint64_t turns = 0, bytes = 0;
  std::vector<Camera> cameras;  // in the order of the rig; none: no camera has had a turn
};

// Reads the monitor's report out of an lfcompositor's `stats`.
MonitorReport monitor_report(const GstStructure* stats);
// {"turns": 70, "bytes": 2100000, "cameras": [{"name": "cam_00_00", "psnr": 25.1, "gain": 1.001, "shift": 0.02,
// "fault": "colour"}, ...]}; numbers that are not known are null, as is the fault of who has none. `names`: of the
// cameras.
nlohmann::json to_json(const MonitorReport& report, const std::vector<std::string>& names);
// The report in the format of Prometheus.
std::string to_metrics(const MonitorReport& report, const std::vector<std::string>& names);

}  // namespace lf::serve
