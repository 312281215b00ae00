// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "report_data.h"

// Pictures of a report as inline SVG, in the colours of the page's style sheet (classes good, fair, bad, line, dim,
// ...).
namespace plots {

// A text with "<", ">", "&" and quotes as HTML has them.
std::string escaped(const std::string& text);
// A number with three digits that count: "0.0113", "12.4", "340".
std::string short_number(double value);

// A value for each camera, beside others'.
struct CameraChart {
  struct Bar {
    std::string camera, value;  // texts that are shown for what the pointer is on
    std::optional<double> height;
    double sigma = 0;  // drawn as a whisker of two of these
    ReportVerdict::Grade grade = ReportVerdict::Grade::kGood;
  };
  std::string label, unit;
  std::vector<Bar> bars;
  std::vector<std::pair<double, std::string>> lines;  // across all, each with what it is
  bool dots = false;                                  // dots in place of bars, for values about 0
};
std::string camera_chart(const CameraChart& chart);

// The cameras from the front (`from_above`: from above) with ellipsoids of 95 %, enlarged as it is written there.
std::string array_map(const ReportData& data, const ReportVerdict& verdict, bool from_above);

// A camera's picture: where the light came to, and what is left of errors there, `enlarged` so many times.
std::string camera_tile(const ReportData::Camera& camera, int columns, int rows, double enlarged);
// The residuals of all cameras, the mean in each part of the picture.
std::string residual_field(const ReportData& data, double enlarged);
// How many times to enlarge residuals so that the usual one can be seen.
double residual_enlargement(const ReportData& data);

// How far a new point is from where it should appear, over its depth.
std::string projection_chart(const ReportData::Solve& solve);

// A bar that shows a share, 0 to 1, of what is worth a better recording.
std::string share_bar(double share, bool soft);

}  // namespace plots

// A page of HTML that needs no other file: what a calibration is worth, and what to do next. `title`: what was
// calibrated, in the words of its owner.
std::string report_page(const ReportData& data, const ReportVerdict& verdict, const std::string& title);
