// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "rig/mesh.h"
#include "rig/rig.h"
#include "view/view.h"

namespace lf::serve {

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
