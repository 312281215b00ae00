// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "calibration/report.h"

namespace lf {

// What pictures of a calibration are drawn from, added to its calibration_report():
// "lights": {"near_m", "far_m"}; "projection": [{"depth_m", "median_px", "worst_px"}]; "soft_modes": [{"code", "text",
// "sigma", "unit", "limit", "soft"}]; "coverage": {"columns", "rows"}; and of each camera that was found "name",
// "width", "height", "position" (metres), "forward", "position_covariance" (3 rows, square metres), "coverage" (how
// many observations fell into each part of its picture, row by row) and "residuals", a sample of them, [x, y, dx, dy]
// pixels.
void add_details(const Solution& solution, const Tracks& tracks, const Placement& placement, const Rig& rig,
                 nlohmann::ordered_json& report);

}  // namespace lf
