// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-render: stills of a rig with images, without GStreamer.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_value.h"
#include "composite/still.h"
#include "image/image_io.h"
#include "progress.h"
#include "quality/quality.h"
#include "rig/rig_json.h"
#include "rig/still_images.h"
#include "run_tool.h"
#include "view/views_json.h"

namespace {

struct Options {
  std::string rig, views, out, truth, cameras, json;
  int every = 1;
  bool i420 = false;
};

// One line of the table and one entry of the JSON file.
struct Row {
  std::string name;
  std::optional<lf::Quality> quality;  // with ground truth
  double coverage = 0;                 // fraction of the pixels that count
  double fragment_bytes = 0, fragments = 0, ms = 0;
};

double covered_fraction(const std::vector<float>& coverage) {
  size_t covered = 0;
  for (const float c : coverage) covered += c > lf::kCovered;
  return static_cast<double>(covered) / static_cast<double>(coverage.size());
}

lf::CameraSet out_of_service(const lf::Rig& rig, const std::string& list) {
  const std::vector<lf::CameraIndex> in_service = lf::parse_camera_list(rig, list);
  lf::CameraSet out;
  auto next = in_service.begin();
  for (lf::CameraIndex i = 0; i < rig.cameras.size(); i++) {
    if (next != in_service.end() && *next == i)
      ++next;
    else
      out.push_back(i);
  }
  return out;
}

lf::Quality quality_against(const lf::Still& still, const lf::Image& picture, const std::string& truth_file) {
  const lf::Image truth = lf::load_image(truth_file);
  if (truth.width() != picture.width() || truth.height() != picture.height())
    throw lf::Error(truth_file + ": has " + std::to_string(truth.width()) + "x" + std::to_string(truth.height()) +
                    " pixels, the view has " + std::to_string(picture.width()) + "x" +
                    std::to_string(picture.height()));
  return lf::compare(picture, truth, still.coverage);
}

// Over the views in which something is covered.
Row mean_of(const std::vector<Row>& rows) {
  Row mean{"mean"};
  lf::Quality quality;
  size_t judged = 0;
  for (const Row& row : rows) {
    mean.coverage += row.coverage / rows.size();
    mean.fragment_bytes += row.fragment_bytes / rows.size();
    mean.fragments += row.fragments / rows.size();
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

void print_row(const Row& row, int name_width) {
  std::printf("%-*s", name_width, row.name.c_str());
  if (row.quality)
    std::printf("  %8.3f  %7.5f  %9d", row.quality->psnr_db, row.quality->ssim, row.quality->max_error);
  else
    std::printf("  %8s  %7s  %9s", "-", "-", "-");
  std::printf("  %8.4f  %14.0f  %9.4g  %8.1f\n", row.coverage, row.fragment_bytes, row.fragments, row.ms);
}

void print_table(const std::vector<Row>& rows) {
  size_t width = 4;
  for (const Row& row : rows) width = std::max(width, row.name.size());
  const int name_width = static_cast<int>(width);
  std::printf("%-*s  %8s  %7s  %9s  %8s  %14s  %9s  %8s\n", name_width, "view", "psnr_db", "ssim", "max_error",
              "coverage", "fragment_bytes", "fragments", "ms");
  for (const Row& row : rows) print_row(row, name_width);
  print_row(mean_of(rows), name_width);
}

// JSON has no infinity: equal pictures (max_error 0) and views without truth have null.
nlohmann::ordered_json to_json(const Row& row) {
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
  json["fragment_bytes"] = count(row.fragment_bytes);
  json["fragments"] = count(row.fragments);
  json["ms"] = row.ms;
  return json;
}

void write_json(const std::vector<Row>& rows, const std::string& path) {
  nlohmann::ordered_json json;
  json["views"] = nlohmann::ordered_json::array();
  for (const Row& row : rows) json["views"].push_back(to_json(row));
  json["mean"] = to_json(mean_of(rows));
  json["mean"].erase("name");
  lf::write_text_file(json.dump(1) + "\n", path);
}

void run(const Options& options) {
  lf::Rig rig = lf::load_rig(options.rig);
  if (options.every != 1) rig = lf::every_nth(rig, options.every);
  const std::vector<lf::NamedView> views = lf::load_views(options.views);
  const lf::Mesh mesh = lf::build_mesh(rig, out_of_service(rig, options.cameras));
  std::error_code error;
  std::filesystem::create_directories(options.out, error);
  if (error) throw lf::Error(options.out + ": can't be made: " + error.message());

  const std::unique_ptr<lf::FragmentRenderer> renderer = lf::make_scalar_renderer();
  lf::StillImages images(rig, options.i420 ? lf::PixelFamily::kI420 : lf::PixelFamily::kRgb);
  Progress progress("rendering", views.size());
  std::vector<Row> rows;
  for (const lf::NamedView& view : views) {
    // Reading images is no part of rendering a view.
    double reading = 0;
    using Clock = std::chrono::steady_clock;
    const auto ms_since = [](Clock::time_point start) {
      return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
    };
    const auto image_of = [&](lf::CameraIndex camera) -> const lf::Image& {
      const Clock::time_point start = Clock::now();
      const lf::Image& image = images.get(camera);
      reading += ms_since(start);
      return image;
    };
    const Clock::time_point start = Clock::now();
    const lf::Still still = lf::render_still(rig, mesh, view.view, *renderer, image_of);
    Row row{view.name};
    row.ms = ms_since(start) - reading;
    row.coverage = covered_fraction(still.coverage);
    row.fragments = static_cast<double>(still.fragments);
    row.fragment_bytes = static_cast<double>(still.fragment_bytes);
    const lf::Image picture =
        still.picture.family() == lf::PixelFamily::kI420 ? lf::to_rgb(still.picture) : still.picture;
    if (!options.truth.empty()) row.quality = quality_against(still, picture, options.truth + "/" + view.name + ".png");
    lf::save_image(picture, options.out + "/" + view.name + ".png");
    rows.push_back(row);
    progress.step();
  }
  progress.finish();
  print_table(rows);
  if (!options.json.empty()) write_json(rows, options.json);
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app("Renders stills of a light field from the images that its rig file names.", "lf-render");
  app.add_option("--rig", options.rig, "Rig file (rig.json)")->required();
  app.add_option("--views", options.views, "Views to render (views.json)")->required();
  app.add_option("--out", options.out, "Folder for NAME.png of each view; made if it is not there")->required();
  app.add_option("--truth", options.truth, "Folder with NAME.png to compare with");
  app.add_option("--every", options.every, "Use rows and columns 0, N, 2N, ... of a grid");
  app.add_option("--cameras", options.cameras, "Ids of the cameras in service, such as 0-3,7 (default: all)");
  app.add_option("--json", options.json, "Write the table to this file as well");
  app.add_flag("--i420", options.i420, "Render in YCbCr 4:2:0 as video sources would");
  return run_tool(app, argc, argv, [&] { run(options); });
}
