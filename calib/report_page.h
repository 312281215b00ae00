// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "report_data.h"

// Functions that draw the figures of a report as inline SVG. Colours come from the classes of the page's style sheet
// (good, fair, bad, line, dim, ...).
namespace plots {

std::string escaped(const std::string& text);
// Formats a number with three significant digits, for example "0.0113", "12.4" or "340".
std::string short_number(double value);

struct CameraChart {
  struct Bar {
    std::string camera, value;
    std::optional<double> height;
    double sigma = 0;  // half length of the whisker: two standard deviations
    ReportVerdict::Grade grade = ReportVerdict::Grade::kGood;
  };
  std::string label, unit;
  std::vector<Bar> bars;
  std::vector<std::pair<double, std::string>> lines;
  bool dots = false;
};
std::string camera_chart(const CameraChart& chart);

// Draws the camera positions with their 95 % confidence ellipsoids, seen from the front or from above. The ellipsoids
// are enlarged to be visible, and the figure states by how much.
std::string array_map(const ReportData& data, const ReportVerdict& verdict, bool from_above);

// Draws one camera's image area, with the regions that the light covered and the residuals, enlarged by the factor
// `enlarged`.
std::string camera_tile(const ReportData::Camera& camera, int columns, int rows, double enlarged);
std::string residual_field(const ReportData& data, double enlarged);
double residual_enlargement(const ReportData& data);

std::string projection_chart(const ReportData::Solve& solve);

// Draws a bar for `share`. The middle of the bar is a share of 1, the limit above which the report recommends a better
// recording.
std::string percentage_bar(double share, bool soft);

}  // namespace plots

// Returns the HTML page of a report, which includes all styles and figures. `title` is the name of the calibrated rig.
std::string report_page(const ReportData& data, const ReportVerdict& verdict, const std::string& title);
