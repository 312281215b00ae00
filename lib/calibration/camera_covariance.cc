// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/camera_covariance.h"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

namespace lf {
namespace {

constexpr const char* kNames[] = {"f", "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "x", "y", "z", "rx", "ry", "rz"};

}  // namespace

std::optional<size_t> CameraCovariance::index_of(const std::string& parameter) const {
  const auto it = std::find(parameters.begin(), parameters.end(), parameter);
  if (it == parameters.end()) return std::nullopt;
  return static_cast<size_t>(it - parameters.begin());
}

std::optional<CameraCovariance> parse_camera_covariance(const JsonValue& camera) {
  const auto value = camera.find("covariance");
  if (!value || !value->find("parameters")) return std::nullopt;
  CameraCovariance covariance;
  for (const JsonValue& parameter : value->at("parameters").elements()) {
    const std::string name = parameter.text();
    if (std::find(std::begin(kNames), std::end(kNames), name) == std::end(kNames))
      parameter.fail("\"" + name + "\" is not a parameter of a camera");
    if (covariance.index_of(name)) parameter.fail("\"" + name + "\" comes twice");
    covariance.parameters.push_back(name);
  }
  const size_t n = covariance.parameters.size();
  const JsonValue matrix = value->at("matrix");
  for (const JsonValue& row : matrix.elements(n))
    for (const JsonValue& element : row.elements(n)) covariance.matrix.push_back(element.number());
  for (size_t i = 0; i < n; i++) {
    if (!(covariance.at(i, i) >= 0)) matrix.fail("a variance is negative");
    for (size_t j = 0; j < i; j++) {
      const double size = std::sqrt(covariance.at(i, i) * covariance.at(j, j));
      if (std::abs(covariance.at(i, j) - covariance.at(j, i)) > 1e-6 * size) matrix.fail("is not symmetric");
      if (std::abs(covariance.at(i, j)) > size * (1 + 1e-6)) matrix.fail("has a correlation above 1");
    }
  }
  return covariance;
}

nlohmann::ordered_json to_json(const CameraCovariance& covariance) {
  const size_t n = covariance.parameters.size();
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (size_t i = 0; i < n; i++)
    rows.push_back(std::vector<double>(covariance.matrix.begin() + static_cast<ptrdiff_t>(i * n),
                                       covariance.matrix.begin() + static_cast<ptrdiff_t>((i + 1) * n)));
  return {{"parameters", covariance.parameters}, {"matrix", rows}};
}

}  // namespace lf
