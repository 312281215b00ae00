// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/render/row.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>

#include <nlohmann/json.hpp>

namespace lf::bench {
namespace {

// As well in all three as `b`, and better in one.
bool beats(const Row& a, const Row& b) {
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
      return other.setting.threads == row.setting.threads && beats(other, row);
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
  // In how many of the natural situations a setting is measured, and a Pareto point.
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

}  // namespace lf::bench
