// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/chart.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <sstream>

#include "base/json_value.h"
#include "base/text.h"

namespace lf::bench {
namespace {

// Distinguishable with colour blindness (Okabe and Ito).
constexpr const char* kColours[] = {"#0072B2", "#D55E00", "#009E73", "#CC79A7",
                                    "#E69F00", "#56B4E9", "#7F7F7F", "#000000"};
constexpr int kMarks[] = {7, 5, 9, 11, 13};
constexpr int kPanelWidth = 620, kPanelHeight = 440, kTitleHeight = 60, kLegendRow = 24;
constexpr double kLabelRoom = 0.012;  // per letter, as a fraction of a panel's width

std::vector<std::string> series_names(const Chart& chart) {
  std::vector<std::string> names;
  for (const Panel& panel : chart.panels)
    for (const Series& series : panel.series)
      if (std::find(names.begin(), names.end(), series.name) == names.end()) names.push_back(series.name);
  return names;
}

// Quotes a gnuplot string literally.
std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("''") : std::string(1, c);
  return out + "'";
}

class Script {
 public:
  Script(const Chart& chart, const std::string& name) : chart_(chart), names_(series_names(chart)) {
    columns_ = chart.panels.size() > 1 ? 2 : 1;
    rows_ = (static_cast<int>(chart.panels.size()) + columns_ - 1) / columns_;
    const int legend_columns = columns_ == 2 ? 3 : 2;
    const int legend_rows = (static_cast<int>(names_.size()) + legend_columns) / legend_columns;
    const int legend = kLegendRow * (legend_rows + 1) + 16, width = columns_ * kPanelWidth,
              height = kTitleHeight + rows_ * kPanelHeight + legend;
    bottom_ = static_cast<double>(legend) / height;
    top_ = 1 - static_cast<double>(kTitleHeight) / height;
    out_ << "# SPDX-License" << "-Identifier: LGPL-2.1-or-later\n# by bench-render --plots\n"
         << "set terminal pngcairo size " << width << "," << height
         << " font 'sans,11' noenhanced background '#FFFFFF'\n"
         << "set output " << quoted(name + ".png") << "\n"
         << "set border 3 lc rgb '#444444'\nset tics nomirror scale 0.6,0\nset grid xtics ytics lc rgb '#DDDDDD' lt 1 "
            "lw 0.7\n"
         << "set key off\n"
         << "set label 100 " << quoted(chart.title) << " at screen 0.5," << 1 - 22.0 / height
         << " center font 'sans:Bold,15'\n";
    if (!chart.note.empty())
      out_ << "set label 101 " << quoted(chart.note) << " at screen 0.5," << 1 - 46.0 / height
           << " center font 'sans,10' textcolor '#666666'\n";
    out_ << "set multiplot\n";
    for (size_t i = 0; i < chart.panels.size(); i++) {
      const bool last = i + 1 == chart.panels.size();
      if (last)
        out_ << "set key at screen 0.5," << 0.35 * kLegendRow / height << " center bottom vertical maxrows "
             << legend_rows << " Left reverse font 'sans,10' samplen 2.5 width 1\n";
      panel(chart.panels[i], static_cast<int>(i), last);
      if (i == 0) out_ << "unset label 100\nunset label 101\n";
    }
    out_ << "unset multiplot\n";
  }
  std::string text() const { return out_.str(); }

 private:
  void panel(const Panel& panel, int index, bool with_legend) {
    const double width = 1.0 / columns_, height = (top_ - bottom_) / rows_;
    const int row = index / columns_, column = index % columns_;
    out_ << "set origin " << column * width << "," << top_ - (row + 1) * height << "\nset size " << width << ","
         << height << "\nset title " << quoted(panel.title) << " font 'sans:Bold,12'\nset xlabel "
         << quoted(panel.x_label) << "\nset ylabel " << quoted(panel.y_label) << "\nunset logscale\n";
    if (panel.log_x) out_ << "set logscale x\n";
    if (panel.log_y) out_ << "set logscale y\n";
    ranges(panel);
    std::string curves;
    const auto add = [&](const std::string& curve) { curves += (curves.empty() ? "plot " : ", ") + curve; };
    if (!panel.front.empty()) {
      data("front", panel.front);
      add("$front using 1:2 with steps lw 5 lc rgb '#D8D8D8' title " + quoted(panel.front_name));
    }
    for (size_t i = 0; i < names_.size(); i++) {
      const std::string colour = std::string(" lc rgb '") + kColours[i % std::size(kColours)] + "'";
      const std::string look = " with linespoints lw 1.8 ps 1.3 pt " + std::to_string(kMarks[i % std::size(kMarks)]) +
                               (dashed(names_[i]) ? " dt 2" : "") + colour +
                               (with_legend ? " title " + quoted(names_[i]) : " notitle");
      const auto series = std::ranges::find(panel.series, names_[i], &Series::name);
      if (series == panel.series.end()) {
        if (with_legend) add("NaN" + look);
        continue;
      }
      const std::string block = "s" + std::to_string(i);
      data(block, series->points);
      add("$" + block + " using 1:2" + look);
      if (std::ranges::any_of(series->points, [](const Point& point) { return !point.label.empty(); }))
        add("$" + block + " using 1:2:3 with labels left offset 1,0 font 'sans,8' textcolor" + colour.substr(3) +
            " notitle");
    }
    out_ << curves << "\n";
  }

  bool dashed(const std::string& name) const {
    for (const Panel& panel : chart_.panels)
      for (const Series& series : panel.series)
        if (series.name == name) return series.dashed;
    return false;
  }

  static size_t longest_label(const Panel& panel) {
    size_t longest = 0;
    for (const Series& series : panel.series)
      for (const Point& point : series.points) longest = std::max(longest, point.label.size());
    return longest;
  }

  void ranges(const Panel& panel) {
    double low[2] = {1e300, 1e300}, high[2] = {-1e300, -1e300};
    for (const Series& series : panel.series)
      for (const Point& point : series.points)
        for (int axis = 0; axis < 2; axis++) {
          const double v = axis == 0 ? point.x : point.y;
          low[axis] = std::min(low[axis], v);
          high[axis] = std::max(high[axis], v);
        }
    for (int axis = 0; axis < 2; axis++) {
      const bool log = axis == 0 ? panel.log_x : panel.log_y;
      const double room = axis == 0 ? 0.08 : 0.12;
      double a = low[axis], b = high[axis];
      if (log) {
        const double factor = std::max(std::pow(b / a, room), 1.15);
        a /= factor;
        b *= factor;
      } else {
        const double more = std::max((b - a) * room, 0.02 * std::abs(b));
        a -= more;
        b += more;
        if (axis == 0) b += (b - a) * kLabelRoom * static_cast<double>(longest_label(panel));
      }
      const char name = axis == 0 ? 'x' : 'y';
      out_ << "set " << name << "range [" << a << ":" << b << "]\n";
      if (axis == 0 && !panel.x_tics.empty())
        out_ << "set xtics " << tics(panel.x_tics) << "\n";
      else if (log)
        out_ << "set " << name << "tics " << tics(round_numbers(a, b)) << "\n";
      else
        out_ << "set " << name << "tics autofreq\n";
    }
  }

  // 1, 2 and 5 of each decade: gnuplot's log tics are at decades only, and the range may contain none.
  static std::vector<double> round_numbers(double low, double high) {
    std::vector<double> numbers;
    for (double decade = std::pow(10, std::floor(std::log10(low))); decade <= high; decade *= 10)
      for (const int digit : {1, 2, 5})
        if (decade * digit >= low && decade * digit <= high) numbers.push_back(decade * digit);
    return numbers;
  }
  static std::string tics(const std::vector<double>& values) {
    std::ostringstream out;
    out.precision(4);
    for (const double value : values) out << (out.str().empty() ? "(" : ",") << "'" << value << "' " << value;
    return out.str() + ")";
  }

  void data(const std::string& name, const std::vector<Point>& points) {
    out_ << "$" << name << " << END\n";
    for (const Point& point : points) out_ << point.x << " " << point.y << " \"" << point.label << "\"\n";
    out_ << "END\n";
  }

  const Chart& chart_;
  const std::vector<std::string> names_;
  int columns_, rows_;
  double top_, bottom_;
  std::ostringstream out_;
};

}  // namespace

void draw(const Chart& chart, const std::string& folder, const std::string& name) {
  if (chart.panels.empty()) return;
  write_text_file(Script(chart, name).text(), folder + "/" + name + ".gp");
  const std::string command = "cd '" + folder + "' && gnuplot '" + name + ".gp'";
  if (std::system(command.c_str()) != 0) throw Error(folder + "/" + name + ".gp: gnuplot could not draw it");
}

}  // namespace lf::bench
