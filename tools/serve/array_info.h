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
  uint32_t count = 0, working = 0;  // cameras that are not known to be lost
};
CameraStates camera_states(GstElement* node);
std::string camera_problem(GstElement* node, uint32_t id);

// Report of the camera monitor in lfcompositor, which compares each camera with a prediction from all other cameras.
struct MonitorReport {
  struct Camera {
    double psnr = 0, gain = 0, shift = 0;  // NaN if unknown
    std::string fault;
  };
  uint64_t turns = 0, bytes = 0;
  std::vector<Camera> cameras;  // in the order of the rig; empty until the first camera has been checked
};

MonitorReport monitor_report(const GstStructure* stats);
// Returns the report as JSON. Unknown numbers (as NaN, which dump() writes as null) and missing
// faults are null.
//    {"turns": 70, "bytes": 2100000,
//     "cameras": [{"name": "cam_00_00", "psnr": 25.1, "gain": 1.001, "shift": 0.02, "fault": "colour"}, ...]}
nlohmann::json to_json(const MonitorReport& report, const std::vector<std::string>& names);
std::string to_metrics(const MonitorReport& report, const std::vector<std::string>& names);

// The data of a camera array that the web page needs. Immutable and therefore thread-safe.
class ArrayInfo {
 public:
  // Loads the rig file. Throws Error.
  explicit ArrayInfo(const std::string& rig);

  // Camera positions and mesh faces as JSON. "right" and "down" are the axes of a person in front of the array.
  //    {"cameras": [{"name": "cam_00_00", "position": [0, 0, 0]}, ...], "faces": [[0, 1, 8], ...],
  //     "right": [1, 0, 0], "down": [0, 1, 0]}
  const std::string& json() const { return json_; }
  const Rig& rig() const { return rig_; }
  // Returns the path of the rig file.
  const std::string& path() const { return path_; }
  const std::vector<std::string>& names() const { return names_; }
  std::string hash() const;
  // Returns true if all cameras show photographs, so that a view without movements always has the same picture.
  bool is_still() const { return is_still_; }
  // Returns the unit of the rig's lengths, "m", or "" if it is unknown.
  const std::string& unit() const { return unit_; }
  double size() const { return size_; }  // distance of the two cameras that are farthest apart, metres
  // Returns the cameras that contribute to a pixel, by descending weight, as JSON: [{"name": "cam_00_00", "weight":
  // 0.5, "sees": true}, ...]. "sees" is false if the point is outside the camera's image.
  nlohmann::json pixel(const View& view, int x, int y) const;
  double coverage(const View& view) const;

 private:
  std::string path_;
  Rig rig_;
  Mesh mesh_;
  std::string json_;
  double size_ = 0;
  bool is_still_ = false;
  std::string unit_;
  std::vector<std::string> names_;
};

}  // namespace lf::serve
