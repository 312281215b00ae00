// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/render/rows.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>
#include <set>

#include <nlohmann/json.hpp>

#include "base/text.h"
#include "bench/chart.h"

namespace lf::bench {
namespace {

// Returns true if `a` dominates `b`: not worse in any of the three figures, and better in at least one.
bool dominates(const Row& a, const Row& b) {
  constexpr double kMeasurable = 1.01;
  const bool faster = a.ns_per_output_pixel * kMeasurable < b.ns_per_output_pixel;
  const bool nearer = a.psnr_reference_db > b.psnr_reference_db + 0.01, smaller = a.bytes_per_view < b.bytes_per_view;
  return a.ns_per_output_pixel <= b.ns_per_output_pixel * kMeasurable &&
         a.psnr_reference_db >= b.psnr_reference_db - 0.01 && a.bytes_per_view <= b.bytes_per_view &&
         (faster || nearer || smaller);
}

std::string figure(double value, const char* format) {
  if (std::isnan(value)) return "-";
  char text[40];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

nlohmann::ordered_json number(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

nlohmann::ordered_json json_of(const Row& row) {
  const Setting& setting = row.setting;
  return {{"renderer", setting.renderer},
          {"codec", setting.codec},
          {"quality", setting.quality > 0 ? nlohmann::ordered_json(setting.quality) : nullptr},
          {"width", row.width()},
          {"height", row.height()},
          {"cameras", row.scene.array.cameras},
          {"threads", setting.threads},
          {"ns_per_output_pixel", number(row.ns_per_output_pixel)},
          {"fps", number(row.fps())},
          {"bytes_per_view", number(row.bytes_per_view)},
          {"max_error", number(row.max_error)},
          {"psnr_reference_db", number(row.psnr_reference_db)},
          {"psnr_truth_db", number(row.psnr_truth_db)},
          {"ssim_truth", number(row.ssim_truth)},
          {"ratio_to_opencv", number(row.ratio_to_opencv)},
          {"scene", row.scene.content},
          {"views", row.scene.views},
          {"distortion", row.scene.array.distortion},
          {"family", pixels_name(setting.pixels)},
          {"default", setting.is_default},
          {"pareto", row.pareto}};
}

}  // namespace

std::string label(const Setting& s) {
  std::string text = s.renderer;
  if (s.renderer.rfind("opencv", 0) != 0) text += " " + pixels_name(s.pixels);
  if (s.codec != "raw") text += " " + s.codec;
  if (s.quality > 0) text += " " + std::to_string(s.quality);
  if (s.threads > 1) text += ", " + std::to_string(s.threads) + " threads";
  return text;
}

std::string label(const SceneOptions& scene) {
  std::string text = scene.content + ", " + std::to_string(scene.array.cameras) + " cameras, " +
                     std::to_string(scene.array.width) + "x" + std::to_string(scene.array.height);
  text += scene.array.distortion ? ", distorted lenses" : ", lenses without distortion";
  if (scene.views > 1) text += ", " + std::to_string(scene.views) + " views";
  return text;
}

void mark_pareto(std::vector<Row>& rows) {
  for (Row& row : rows)
    row.pareto = !std::isnan(row.psnr_reference_db) && std::none_of(rows.begin(), rows.end(), [&](const Row& other) {
      return other.setting.threads == row.setting.threads && dominates(other, row);
    });
}

void print_table(const std::vector<Row>& rows) {
  if (rows.empty()) return;
  std::printf("\n%s\n%-34s %8s %8s %7s %10s %6s %8s %9s %7s\n", label(rows.front().scene).c_str(),
              "  (* Pareto point, d default)", "ns/outpx", "fps", "ratio", "bytes", "error", "PSNR ref", "PSNR true",
              "SSIM");
  for (const Row& row : rows)
    std::printf("%s%s%-32s %8s %8s %7s %10s %6s %8s %9s %7s\n", row.pareto ? "*" : " ",
                row.setting.is_default ? "d" : " ", label(row.setting).c_str(),
                figure(row.ns_per_output_pixel, "%.2f").c_str(), figure(row.fps(), "%.1f").c_str(),
                figure(row.ratio_to_opencv, "%.2f").c_str(), figure(row.bytes_per_view, "%.0f").c_str(),
                figure(row.max_error, "%.2f").c_str(), figure(row.psnr_reference_db, "%.2f").c_str(),
                figure(row.psnr_truth_db, "%.2f").c_str(), figure(row.ssim_truth, "%.4f").c_str());
  std::fflush(stdout);
}

void print_pareto(const std::vector<Row>& rows) {
  // Number of natural situations in which a setting was measured, and in how many of these the setting is
  // Pareto-optimal.
  struct Count {
    int measured = 0, pareto = 0;
    bool is_default = false;
  };
  std::map<std::string, Count> counts;
  for (const Row& row : rows) {
    if (row.scene.content != "natural") continue;
    Count& count = counts[label(row.setting)];
    count.measured++;
    count.pareto += row.pareto;
    count.is_default = row.setting.is_default;
  }
  std::printf("\nPareto points (time, error, bytes) of the natural scene, in how many of the situations measured:\n");
  for (const auto& [name, count] : counts)
    if (count.pareto > 0 || count.is_default)
      std::printf("  %-36s %3d of %3d%s\n", name.c_str(), count.pareto, count.measured,
                  !count.is_default                   ? ""
                  : 2 * count.pareto > count.measured ? "   default, a Pareto point"
                                                      : "   default, NOT a Pareto point");
}

std::string to_json(const std::vector<Row>& rows) {
  nlohmann::ordered_json json;
  json["rows"] = nlohmann::ordered_json::array();
  for (const Row& row : rows) json["rows"].push_back(json_of(row));
  return json.dump(1) + "\n";
}

namespace {

constexpr int kSizes = 4, kWidths[kSizes] = {320, 640, 1280, 1920};

struct Which {
  std::string codec;  // raw or jpeg
  int cameras = 64;
  bool distortion = true;
  std::string content = "natural";
};

bool matches(const Row& row, const Which& which, int width) {
  const Setting& s = row.setting;
  return row.is_ours() && row.width() == width && row.scene.content == which.content && row.scene.views == 1 &&
         row.scene.array.cameras == which.cameras && row.scene.array.distortion == which.distortion && s.threads == 1 &&
         s.codec.rfind(which.codec, 0) == 0 && (which.codec == "raw" || s.quality == 90);
}

// Returns the fastest matching default, or the fastest match if no default matches.
const Row* find(const std::vector<Row>& rows, const Which& which, int width) {
  const Row* best = nullptr;
  for (const Row& row : rows) {
    if (!matches(row, which, width)) continue;
    const auto rank = [](const Row& r) { return std::pair(!r.setting.is_default, r.ns_per_output_pixel); };
    if (!best || rank(row) < rank(*best)) best = &row;
  }
  return best;
}

using Figure = std::function<double(int width)>;

// `goal`: one per size; `at_least`: a lower bound, otherwise an upper bound.
void print_line(const char* what, const Figure& figure, const double (&goal)[kSizes], bool at_least) {
  std::printf("%-58s", what);
  bool met = true, known = true;
  for (int i = 0; i < kSizes; i++) {
    const double value = figure(kWidths[i]);
    if (std::isnan(value)) {
      std::printf("       - / %-4g", goal[i]);
      known = false;
      continue;
    }
    met &= at_least ? value >= goal[i] : value <= goal[i];
    std::printf(" %7.2f / %-4g", value, goal[i]);
  }
  std::printf(" %s\n", !met ? "NOT met" : known ? "met" : "-");
}

// Prints the worst errors of the rows that match any of `all`.
void print_errors(const std::vector<Row>& rows, const std::vector<Which>& all) {
  std::printf("%-58s", "  max error of 255, PSNR in dB");
  for (const int width : kWidths) {
    double error = Row::kUnknown, psnr = Row::kUnknown;
    for (const Which& which : all)
      if (const Row* row = find(rows, which, width)) {
        error = std::fmax(error, row->max_error);  // both ignore NaN
        psnr = std::fmin(psnr, row->psnr_reference_db);
      }
    if (std::isnan(error))
      std::printf(" %6s, %-6s", "-", "-");
    else
      std::printf(" %6.2f, %-6.2f", error, psnr);
  }
  std::printf("\n");
}

}  // namespace

void print_acceptance(const std::vector<Row>& rows) {
  const auto value = [&](const Which& which, double Row::*field) {
    return [&rows, which, field](int width) {
      const Row* row = find(rows, which, width);
      return row ? row->*field : Row::kUnknown;
    };
  };
  const auto quotient = [&](const Which& a, const Which& b) {
    return [&rows, a, b](int width) {
      const Row *over = find(rows, a, width), *under = find(rows, b, width);
      return over && under ? over->ns_per_output_pixel / under->ns_per_output_pixel : Row::kUnknown;
    };
  };
  // Worst case over the error scenes and the natural scene.
  const auto worst = [&](double Row::*field, bool least) {
    return [&rows, field, least](int width) {
      double result = Row::kUnknown;
      for (const char* content : {"natural", "checkerboard"})
        if (const Row* row = find(rows, {"raw", 64, true, content}, width))
          result = std::isnan(result) ? row->*field
                   : least            ? std::min(result, row->*field)
                                      : std::max(result, row->*field);
      return result;
    };
  };
  std::printf("\n%-58s  320x240        640x480        1280x720       1920x1080\n", "promised (shown / goal)");
  print_line("64 cameras, raw: times faster than OpenCV", value({"raw"}, &Row::ratio_to_opencv), {6, 7, 8, 8}, true);
  print_line("  max error of 255, natural and checkerboard", worst(&Row::max_error, false), {2, 2, 2, 2}, false);
  print_line("  PSNR against exact arithmetic, dB", worst(&Row::psnr_reference_db, true), {50, 50, 50, 50}, true);
  const Which raw{"raw"}, jpeg{"jpeg"};
  const auto with = [](Which which, int cameras) {
    which.cameras = cameras;
    return which;
  };
  print_line("JPEG both ways", value(jpeg, &Row::ratio_to_opencv), {4, 4, 4, 4}, true);
  print_errors(rows, {jpeg});
  print_line("cost of 256 against 16 cameras, JPEG", quotient(with(jpeg, 256), with(jpeg, 16)),
             {1.25, 1.25, 1.25, 1.25}, false);
  print_errors(rows, {with(jpeg, 256), with(jpeg, 16)});
  const Which undistorted{"raw", 64, false};
  print_line("distortion on against off, raw", quotient(raw, undistorted), {1.05, 1.05, 1.05, 1.05}, false);
  print_errors(rows, {raw, undistorted});
}

namespace {

using Rows = std::vector<const Row*>;

std::string size_name(const Row& row) { return std::to_string(row.width()) + " x " + std::to_string(row.height()); }

// Merges the qualities of a codec, and the numbers of threads, into one series.
std::string series_name(const Row& row) {
  Setting setting = row.setting;
  setting.quality = 0;
  setting.threads = 1;
  return label(setting);
}

// OpenCV's picture is correct only without distortion: its error comes from the situation without distortion.
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

// Returns the least x for each y and above, over all series.
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

// Adds time over one varying parameter; all other parameters have their most common value. Adds nothing if the
// parameter does not vary.
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
  // A setting without a sweep would be a single mark.
  std::erase_if(panel.series, [](const Series& series) { return series.points.size() < 2; });
  if (!panel.series.empty()) chart.panels.push_back(std::move(panel));
}

template <class Condition>
Rows select_rows(const std::vector<Row>& rows, const Condition& condition) {
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
  // One quality represents the codec if quality does not vary.
  const int quality = [&] {
    int q = 0;
    for (const Row& row : rows)
      if (row.setting.is_baseline && row.setting.quality > 0 && (q == 0 || row.setting.quality == 90))
        q = row.setting.quality;
    return q;
  }();
  const auto usual_quality = [&](const Row& row) { return row.setting.quality == 0 || row.setting.quality == quality; };

  const Rows at_rest = select_rows(rows, [&](const Row& row) { return usual(row) && usual_array(row); });
  const std::string array = std::to_string(cameras) + " cameras, one thread";
  draw(error_chart(rows, at_rest, "Time against error: " + array, "ns per output pixel",
                   [](const Row& row) { return row.ns_per_output_pixel; }),
       folder, "time-error");
  draw(error_chart(rows, at_rest, "Bytes against error: " + array, "bytes per output pixel",
                   [](const Row& row) { return row.bytes_per_view / row.pixels(); }),
       folder, "bytes-error");

  // Sweeps of other parameters use the size with the most rows.
  std::map<std::string, int> counts;
  for (const Row& row : rows) counts[size_name(row)]++;
  const std::string size =
      std::max_element(counts.begin(), counts.end(), [](auto& a, auto& b) { return a.second < b.second; })->first;
  const auto here = [&](const Row& row) { return size_name(row) == size && usual_quality(row); };
  Chart scaling{"What time depends on", "down is better", {}};
  add_sweep(
      select_rows(rows, [&](const Row& row) { return here(row) && usual(row); }), "Cameras, at " + size, "cameras",
      [](const Row& row) { return static_cast<double>(row.scene.array.cameras); }, true, scaling);
  add_sweep(
      select_rows(rows, [&](const Row& row) { return usual_quality(row) && usual(row) && usual_array(row); }),
      "Resolution", "megapixels of the view", [](const Row& row) { return row.pixels() / 1e6; }, true, scaling);
  add_sweep(
      select_rows(rows, [&](const Row& row) { return here(row) && row.setting.threads == 1 && usual_array(row); }),
      "Views of the same cameras, at " + size, "views",
      [](const Row& row) { return static_cast<double>(row.scene.views); }, false, scaling);
  Rows threads =
      select_rows(rows, [&](const Row& row) { return here(row) && row.scene.views == 1 && usual_array(row); });
  add_sweep(
      threads, "Threads, at " + size, "threads",
      [](const Row& row) { return static_cast<double>(row.setting.threads); }, false, scaling);
  draw(scaling, folder, "scaling");
}

}  // namespace lf::bench
