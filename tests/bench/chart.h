// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

namespace lf::bench {

// Line charts with gnuplot: panels side by side with one legend.
struct Point {
  double x, y;
  std::string label;
};
struct Series {
  std::string name;
  bool dashed = false;
  std::vector<Point> points;  // joined in this order
};
struct Panel {
  std::string title, x_label, y_label;
  bool log_x = true, log_y = false;
  std::vector<double> x_tics;  // empty: round numbers
  std::vector<Series> series;
  std::vector<Point> front;  // a staircase behind the series; may be empty
  std::string front_name;
};
struct Chart {
  std::string title, note;
  std::vector<Panel> panels;
};

// Writes FOLDER/NAME.gp and runs gnuplot to create FOLDER/NAME.png. Throws Error on failure.
void draw(const Chart& chart, const std::string& folder, const std::string& name);

}  // namespace lf::bench
