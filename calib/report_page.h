// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "report_data.h"

// Figures of a report as inline SVG, styled by the classes of the page's style sheet (good, fair, bad, line, dim, ...).
namespace plots {

// Returns the text with HTML entities for special characters.
std::string escaped(const std::string& text);
// Returns a number with three significant digits: "0.0113", "12.4", "340".
std::string short_number(double value);

// A chart with one value per camera.
struct CameraChart {
  struct Bar {
    std::string camera, value;  // tooltip texts
    std::optional<double> height;
    double sigma = 0;  // whisker: two sigmas
    ReportVerdict::Grade grade = ReportVerdict::Grade::kGood;
  };
  std::string label, unit;
  std::vector<Bar> bars;
  std::vector<std::pair<double, std::string>> lines;  // horizontal lines with labels
  bool dots = false;                                  // dots instead of bars, for values around 0
};
std::string camera_chart(const CameraChart& chart);

// Draws the cameras from the front or from above, with 95 % ellipsoids; the figure states their magnification.
std::string array_map(const ReportData& data, const ReportVerdict& verdict, bool from_above);

// Draws a camera's image area with light coverage and residuals. `enlarged`: magnification of the residuals.
std::string camera_tile(const ReportData::Camera& camera, int columns, int rows, double enlarged);
// Draws the mean residual of all cameras in each image cell.
std::string residual_field(const ReportData& data, double enlarged);
// Returns a magnification that makes typical residuals visible.
double residual_enlargement(const ReportData& data);

// Plots the predicted reprojection error of a new point over its depth.
std::string projection_chart(const ReportData::Solve& solve);

// Draws a bar; a share of 1, where a better recording is recommended, is the middle of the bar.
std::string percentage_bar(double share, bool soft);

}  // namespace plots

// Returns a self-contained HTML page with the assessment of a calibration. `title`: name of the calibrated rig.
std::string report_page(const ReportData& data, const ReportVerdict& verdict, const std::string& title);
