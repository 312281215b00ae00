// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/json_value.h"

namespace lf {

// How well a camera's parameters are known: the member "covariance" of a camera in a rig file,
//   {"parameters": ["f", "cx", "cy", "k1", "k2", "x", "y", "z", "rx", "ry", "rz"], "matrix": [[...], ...]}
// f, cx, cy in pixels; k1, k2, p1, p2 as in the lens; x, y, z the position in metres; rx, ry, rz in radians: the
// rotation, about the world's axes, by which the true orientation may differ. Any of them may be absent (a parameter
// that was not estimated).
struct CameraCovariance {
  std::vector<std::string> parameters;
  std::vector<double> matrix;  // row by row, parameters.size() squared

  double at(size_t row, size_t column) const { return matrix[row * parameters.size() + column]; }
  std::optional<size_t> index_of(const std::string& parameter) const;
};

// `camera` is an element of a rig file's "cameras". Nothing where it has no (or an empty) covariance. Throws Error
// naming the place where it is not a symmetric positive semidefinite matrix of the right size.
std::optional<CameraCovariance> parse_camera_covariance(const JsonValue& camera);
nlohmann::ordered_json to_json(const CameraCovariance& covariance);

}  // namespace lf
