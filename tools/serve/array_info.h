// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <gst/gst.h>
#include <nlohmann/json_fwd.hpp>

#include "rig/mesh.h"
#include "rig/rig.h"
#include "view/view.h"

namespace lf::serve {

// How the cameras of an lfcameranode are. Any thread.
struct CameraStates {
  uint32_t count = 0, working = 0;  // working: not lost, as far as is known
};
CameraStates camera_states(GstElement* node);
// Why the camera of this id was lost; "" where nothing is known.
std::string camera_problem(GstElement* node, uint32_t id);

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

// What the page tells of the cameras, as JSON. Immutable; thread-safe.
class ArrayInfo {
 public:
  // Throws Error.
  explicit ArrayInfo(const std::string& rig);

  // {"cameras": [{"name": "cam_00_00", "position": [0, 0, 0]}, ...], "faces": [[0, 1, 8], ...],
  // "right": [1, 0, 0], "down": [0, 1, 0]}: the axes of whoever stands before the array.
  const std::string& json() const { return json_; }
  const Rig& rig() const { return rig_; }
  const std::vector<std::string>& names() const { return names_; }  // names of the cameras
  // The hash of all that pictures depend on, in hexadecimal digits.
  std::string hash() const;
  double size() const { return size_; }  // metres between the two cameras that are farthest apart
  // The cameras that make a pixel of a view, the heaviest first: [{"name": "cam_00_00", "weight": 0.5, "sees": true},
  // ...]
  nlohmann::json pixel(const View& view, int x, int y) const;
  // The share of the view that cameras make, 0..1.
  double coverage(const View& view) const;

 private:
  Rig rig_;
  Mesh mesh_;
  std::string json_;
  double size_ = 0;
  std::vector<std::string> names_;
};

}  // namespace lf::serve
