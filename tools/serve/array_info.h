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

struct CameraStates {
  uint32_t count = 0, working = 0;  // working: not known to be lost
};
CameraStates camera_states(GstElement* node);
// Returns why the camera with this id was lost; "": unknown.
std::string camera_problem(GstElement* node, uint32_t id);

// Report of lfcompositor's camera monitor.
struct MonitorReport {
  struct Camera {
    double psnr = 0, gain = 0, shift = 0;  // NaN: unknown
    std::string fault;                     // "": none
  };
  uint64_t turns = 0, bytes = 0;
  std::vector<Camera> cameras;  // in rig order; empty: no camera has been checked yet
};

MonitorReport monitor_report(const GstStructure* stats);
// Returns {"turns": 70, "bytes": 2100000, "cameras": [{"name": "cam_00_00", "psnr": 25.1, "gain": 1.001, "shift": 0.02,
// "fault": "colour"}, ...]}. Unknown numbers and missing faults are null. `names`: camera names.
nlohmann::json to_json(const MonitorReport& report, const std::vector<std::string>& names);
std::string to_metrics(const MonitorReport& report, const std::vector<std::string>& names);

// Camera array data for the web page. Immutable; thread-safe.
class ArrayInfo {
 public:
  // Throws Error.
  explicit ArrayInfo(const std::string& rig);

  // {"cameras": [{"name": "cam_00_00", "position": [0, 0, 0]}, ...], "faces": [[0, 1, 8], ...], "right": [1, 0, 0],
  // "down": [0, 1, 0]}, with the axes of a person in front of the array.
  const std::string& json() const { return json_; }
  const Rig& rig() const { return rig_; }
  const std::vector<std::string>& names() const { return names_; }
  std::string hash() const;
  double size() const { return size_; }  // metres between the two cameras farthest apart
  // Returns the cameras that contribute to a pixel, by descending weight: [{"name": "cam_00_00", "weight": 0.5, "sees":
  // true}, ...]
  nlohmann::json pixel(const View& view, int x, int y) const;
  // Returns the fraction of the view that the cameras cover, 0..1.
  double coverage(const View& view) const;

 private:
  Rig rig_;
  Mesh mesh_;
  std::string json_;
  double size_ = 0;
  std::vector<std::string> names_;
};

}  // namespace lf::serve
