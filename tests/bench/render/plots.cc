// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/render/plots.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <set>

#include "base/error.h"
#include "bench/chart.h"

namespace lf::bench {
namespace {

using Rows = std::vector<const Row*>;

std::string size_name(const Row& row) { return std::to_string(row.width()) + " x " + std::to_string(row.height()); }

// Qualities of one codec are one series, and so are numbers of threads.
std::string series_name(const Row& row) {
  Setting setting = row.setting;
  setting.quality = 0;
  setting.threads = 1;
  return label(setting);
}

// OpenCV's picture is right only without distortion: its error is that of the situation where it is known.
double psnr_of(const Row& row, const std::vector<Row>& all) {
  if (std::isfinite(row.psnr_reference_db)) return row.psnr_reference_db;
  double elsewhere = Row::kUnknown;
  for (const Row& other : all) {
    if (label(other.setting) != label(row.setting) || other.scene.content != row.scene.content ||
        !std::isfinite(other.psnr_reference_db))
      continue;
    if (size_name(other) == size_name(row)) return other.psnr_reference_db;
    elsewhere = other.psnr_reference_db;
  }
  return elsewhere;
}

void sort_points(std::vector<Series>& all) {
  for (Series& series : all)
    std::sort(series.points.begin(), series.points.end(), [](const Point& a, const Point& b) { return a.x < b.x; });
}

Series& series_of(const Row& row, std::vector<Series>& all) {
  const std::string name = series_name(row);
  for (Series& series : all)
    if (series.name == name) return series;
  all.push_back({name, !row.is_ours(), {}});
  return all.back();
}

// The least x for each y and above, of all series.
std::vector<Point> front_of(const std::vector<Series>& all) {
  std::vector<Point> points;
  for (const Series& series : all) points.insert(points.end(), series.points.begin(), series.points.end());
  std::sort(points.begin(), points.end(), [](const Point& a, const Point& b) { return a.x < b.x; });
  std::vector<Point> front;
  for (const Point& point : points)
    if (front.empty() || point.y > front.back().y) front.push_back({point.x, point.y, ""});
  return front;
}

// Error over `x`, a panel for each size.
Chart error_chart(const std::vector<Row>& rows, const Rows& chosen, const std::string& title,
                  const std::string& x_label, double (*x)(const Row&)) {
  Chart chart{title, "up is better, left is better; the grey stairs are the Pareto front", {}};
  for (const Row* row : chosen) {
    const double psnr = psnr_of(*row, rows);
    if (!std::isfinite(psnr)) continue;
    const std::string size = size_name(*row);
    auto panel =
        std::find_if(chart.panels.begin(), chart.panels.end(), [&](const Panel& p) { return p.title == size; });
    if (panel == chart.panels.end())
      panel = chart.panels.insert(chart.panels.end(), {size, x_label, "PSNR against exact arithmetic, dB"});
    series_of(*row, panel->series)
        .points.push_back({x(*row), psnr, row->setting.quality > 0 ? std::to_string(row->setting.quality) : ""});
  }
  for (Panel& panel : chart.panels) {
    panel.front = front_of(panel.series);
    panel.front_name = "Pareto front";
  }
  return chart;
}

// Time over one thing that varies while all else is as in most rows. Nothing if it doesn't vary.
void add_sweep(const Rows& rows, const std::string& title, const std::string& x_label, double (*x)(const Row&),
               bool log_x, Chart& chart) {
  Panel panel{title, x_label, "ns per output pixel", log_x, true};
  std::set<double> values;
  for (const Row* row : rows) {
    series_of(*row, panel.series).points.push_back({x(*row), row->ns_per_output_pixel, ""});
    values.insert(x(*row));
  }
  if (values.size() < 2) return;
  panel.x_tics.assign(values.begin(), values.end());
  sort_points(panel.series);
  // A setting that was not swept would be a lone mark.
  std::erase_if(panel.series, [](const Series& series) { return series.points.size() < 2; });
  if (!panel.series.empty()) chart.panels.push_back(std::move(panel));
}

template <class Condition>
Rows those(const std::vector<Row>& rows, const Condition& condition) {
  Rows chosen;
  for (const Row& row : rows)
    if (row.scene.content == "natural" && row.scene.array.distortion && condition(row)) chosen.push_back(&row);
  return chosen;
}

}  // namespace

void require_gnuplot() {
  if (std::system("gnuplot --version >/dev/null 2>&1") != 0)
    throw Error("plots need gnuplot: apt-get install gnuplot-nox");
}

void write_plots(const std::vector<Row>& rows, const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw Error(folder + ": can't be made: " + error.message());
  if (rows.empty()) return;
  const Row& first = rows.front();
  const int cameras = first.scene.array.cameras;
  const auto usual = [&](const Row& row) { return row.setting.threads == 1 && row.scene.views == 1; };
  const auto usual_array = [&](const Row& row) { return row.scene.array.cameras == cameras; };
  // One quality stands for the codec where quality is not what varies.
  const int quality = [&] {
    int q = 0;
    for (const Row& row : rows)
      if (row.setting.is_baseline && row.setting.quality > 0 && (q == 0 || row.setting.quality == 90))
        q = row.setting.quality;
    return q;
  }();
  const auto usual_quality = [&](const Row& row) { return row.setting.quality == 0 || row.setting.quality == quality; };

  const Rows at_rest = those(rows, [&](const Row& row) { return usual(row) && usual_array(row); });
  const std::string array = std::to_string(cameras) + " cameras, one thread";
  draw(error_chart(rows, at_rest, "Time against error: " + array, "ns per output pixel",
                   [](const Row& row) { return row.ns_per_output_pixel; }),
       folder, "time-error");
  draw(error_chart(rows, at_rest, "Bytes against error: " + array, "bytes per output pixel",
                   [](const Row& row) { return row.bytes_per_view / row.pixels(); }),
       folder, "bytes-error");

  // Sweeps other than that of the size are at the size with the most rows.
  std::map<std::string, int> counts;
  for (const Row& row : rows) counts[size_name(row)]++;
  const std::string size =
      std::max_element(counts.begin(), counts.end(), [](auto& a, auto& b) { return a.second < b.second; })->first;
  const auto here = [&](const Row& row) { return size_name(row) == size && usual_quality(row); };
  Chart scaling{"What time depends on", "down is better", {}};
  add_sweep(
      those(rows, [&](const Row& row) { return here(row) && usual(row); }), "Cameras, at " + size, "cameras",
      [](const Row& row) { return static_cast<double>(row.scene.array.cameras); }, true, scaling);
  add_sweep(
      those(rows, [&](const Row& row) { return usual_quality(row) && usual(row) && usual_array(row); }), "Resolution",
      "megapixels of the view", [](const Row& row) { return row.pixels() / 1e6; }, true, scaling);
  add_sweep(
      those(rows, [&](const Row& row) { return here(row) && row.setting.threads == 1 && usual_array(row); }),
      "Views of the same cameras, at " + size, "views",
      [](const Row& row) { return static_cast<double>(row.scene.views); }, false, scaling);
  Rows threads = those(rows, [&](const Row& row) { return here(row) && row.scene.views == 1 && usual_array(row); });
  add_sweep(
      threads, "Threads, at " + size, "threads",
      [](const Row& row) { return static_cast<double>(row.setting.threads); }, false, scaling);
  draw(scaling, folder, "scaling");
}

}  // namespace lf::bench
