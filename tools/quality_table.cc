// SPDX-License-Identifier: LGPL-2.1-or-later
#include "quality_table.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <nlohmann/json.hpp>

#include "base/json_value.h"

namespace {

// Over the views in which something is covered.
QualityRow mean_of(const std::vector<QualityRow>& rows) {
  QualityRow mean{"mean"};
  lf::Quality quality;
  size_t judged = 0;
  for (const QualityRow& row : rows) {
    mean.coverage += row.coverage / rows.size();
    mean.cameras += row.cameras / rows.size();
    mean.ms += row.ms / rows.size();
    if (!row.quality || std::isnan(row.quality->psnr_db)) continue;
    judged++;
    quality.psnr_db += row.quality->psnr_db;
    quality.ssim += row.quality->ssim;
    quality.max_error = std::max(quality.max_error, row.quality->max_error);
  }
  if (judged == 0) return mean;
  quality.psnr_db /= static_cast<double>(judged);
  quality.ssim /= static_cast<double>(judged);
  quality.coverage = mean.coverage;
  mean.quality = quality;
  return mean;
}

void print_row(const QualityRow& row, int name_width) {
  std::printf("%-*s", name_width, row.name.c_str());
  if (row.quality)
    std::printf("  %8.3f  %7.5f  %9d", row.quality->psnr_db, row.quality->ssim, row.quality->max_error);
  else
    std::printf("  %8s  %7s  %9s", "-", "-", "-");
  std::printf("  %8.4f  %7.4g  %8.1f\n", row.coverage, row.cameras, row.ms);
}

nlohmann::ordered_json to_json(const QualityRow& row) {
  nlohmann::ordered_json json;
  const auto number = [](double v) { return std::isfinite(v) ? nlohmann::ordered_json(v) : nullptr; };
  // Counts are whole numbers but for their means.
  const auto count = [](double v) {
    return v == std::floor(v) ? nlohmann::ordered_json(static_cast<uint64_t>(v)) : nlohmann::ordered_json(v);
  };
  json["name"] = row.name;
  json["psnr_db"] = row.quality ? number(row.quality->psnr_db) : nullptr;
  json["ssim"] = row.quality ? number(row.quality->ssim) : nullptr;
  json["max_error"] = row.quality ? nlohmann::ordered_json(row.quality->max_error) : nullptr;
  json["coverage"] = row.coverage;
  json["cameras"] = count(row.cameras);
  json["ms"] = row.ms;
  return json;
}

}  // namespace

void print_table(const std::vector<QualityRow>& rows) {
  size_t width = 4;
  for (const QualityRow& row : rows) width = std::max(width, row.name.size());
  const int name_width = static_cast<int>(width);
  std::printf("%-*s  %8s  %7s  %9s  %8s  %7s  %8s\n", name_width, "view", "psnr_db", "ssim", "max_error", "coverage",
              "cameras", "ms");
  for (const QualityRow& row : rows) print_row(row, name_width);
  print_row(mean_of(rows), name_width);
}

void write_json(const std::vector<QualityRow>& rows, const std::string& path) {
  nlohmann::ordered_json json;
  json["views"] = nlohmann::ordered_json::array();
  for (const QualityRow& row : rows) json["views"].push_back(to_json(row));
  json["mean"] = to_json(mean_of(rows));
  json["mean"].erase("name");
  lf::write_text_file(json.dump(1) + "\n", path);
}
