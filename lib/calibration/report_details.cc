// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/report_details.h"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "calibration/soft_modes.h"
#include "calibration/triangulation.h"

namespace lf {
namespace {

using nlohmann::ordered_json;

constexpr int kColumns = 8, kRows = 6;  // of a camera's picture, in which coverage is counted
constexpr size_t kMostResiduals = 60;   // of a camera

double rounded(double value) { return std::round(value * 1e4) / 1e4; }

ordered_json triple(const Vec3& v) { return {v.x, v.y, v.z}; }

void add_observations(const Solution& solution, const Tracks& tracks, const std::vector<uint32_t>& own, size_t camera,
                      ordered_json& value) {
  const CameraState& state = solution.scene.cameras[camera];
  std::vector<int> counts(kColumns * kRows);
  ordered_json residuals = ordered_json::array();
  const size_t every = (own.size() + kMostResiduals - 1) / kMostResiduals;
  for (size_t k = 0; k < own.size(); k++) {
    const Observation& o = tracks.observations[own[k]];
    if (!solution.inliers[own[k]]) continue;
    const int column = static_cast<int>((o.pixel.x + 0.5) * kColumns / state.width);
    const int row = static_cast<int>((o.pixel.y + 0.5) * kRows / state.height);
    counts[static_cast<size_t>(std::clamp(row, 0, kRows - 1) * kColumns + std::clamp(column, 0, kColumns - 1))]++;
    const TargetState& target = solution.scene.targets[o.position];
    if (k % every != 0 || !state.used || !target.has(o.light)) continue;
    if (const auto e = residual(state, target, o))
      residuals.push_back({rounded(o.pixel.x), rounded(o.pixel.y), rounded(e->x), rounded(e->y)});
  }
  value["coverage"] = counts;
  value["residuals"] = std::move(residuals);
}

}  // namespace

void add_details(const Solution& solution, const Tracks& tracks, const Placement& placement, const Rig& rig,
                 ordered_json& report) {
  const LightRange range = light_range(solution, placement);
  report["lights"] = {{"near_m", range.near}, {"far_m", range.far}};
  report["projection"] = ordered_json::array();
  for (const ProjectionError& error : projection_errors(solution, placement))
    report["projection"].push_back({{"depth_m", error.depth}, {"median_px", error.middle}, {"worst_px", error.worst}});
  report["soft_modes"] = ordered_json::array();
  for (const SoftMode& mode : soft_modes(solution, placement))
    report["soft_modes"].push_back({{"code", mode.code},
                                    {"text", mode.text},
                                    {"sigma", mode.sigma},
                                    {"unit", mode.unit},
                                    {"limit", mode.limit},
                                    {"soft", mode.is_soft()}});
  report["coverage"] = {{"columns", kColumns}, {"rows", kRows}};
  const auto lists = observations_of_cameras(tracks);
  for (size_t i = 0; i < tracks.cameras.size(); i++) {
    ordered_json& value = report["cameras"][i];
    value["width"] = tracks.cameras[i].width, value["height"] = tracks.cameras[i].height;
    add_observations(solution, tracks, lists[i], i, value);
    const auto index = rig.index_of_id(tracks.cameras[i].id);
    if (!index || !solution.scene.cameras[i].used) continue;
    value["name"] = rig.cameras[*index].name;
    value["position"] = triple(rig.cameras[*index].pose.position);
    value["forward"] = triple(rig.cameras[*index].pose.forward());
    const CameraCovariance covariance = covariance_in_rig(solution.uncertainty, i, placement.world_from_scene);
    const size_t first = *covariance.index_of("x");
    value["position_covariance"] = ordered_json::array();
    for (size_t r = 0; r < 3; r++)
      value["position_covariance"].push_back(
          {covariance.at(first + r, first), covariance.at(first + r, first + 1), covariance.at(first + r, first + 2)});
  }
}

}  // namespace lf
