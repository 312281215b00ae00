// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-render: stills of a rig with images, without GStreamer.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_value.h"
#include "command_line.h"
#include "composite/still.h"
#include "focus/focus_still.h"
#include "image/image_io.h"
#include "image/sharpen.h"
#include "progress.h"
#include "quality/outliers.h"
#include "quality/quality.h"
#include "render/detail.h"
#include "render/focus_range.h"
#include "rig/rig_json.h"
#include "rig/still_images.h"
#include "view/views_json.h"

namespace {

struct Options {
  std::string rig, views, out, truth, cameras, json;
  int every = 1;
  double distance = 0;  // of the focal plane, where the views don't say
  bool i420 = false, leave_one_out = false;
  std::string focus = "surface", resampling = "sharpened";
  double aperture = 0;  // metres
  int nearest_cameras = 0;
  lf::FocusControl::Settings surface{.mode = lf::FocusMode::kSurface};

  lf::Blending blending() const { return lf::blending_of(aperture, nearest_cameras); }
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

// Focused and sampled as the options say.
lf::Still render(const lf::Rig& rig, const lf::Mesh& mesh, const lf::View& view, const lf::FragmentRenderer& renderer,
                 const lf::CameraImages& images, const Options& options) {
  const lf::View focused = options.focus == "plane" ? view : lf::focus_still(rig, mesh, view, images, options.surface);
  if (options.resampling == "bilinear") return lf::render_still(rig, mesh, focused, renderer, images);
  std::map<lf::CameraIndex, lf::Image> sharpened;
  return lf::render_still(rig, mesh, focused, renderer, [&](lf::CameraIndex camera) -> const lf::Image& {
    if (!lf::shows_detail(view, rig.cameras[camera])) return images(camera);
    if (!sharpened.contains(camera)) sharpened[camera] = lf::sharpened(images(camera));
    return sharpened[camera];
  });
}

// Predicts cameras from the others.
class Predictor {
 public:
  Predictor(const lf::Rig& rig, const Options& options)
      : rig_(rig), options_(options), images_(rig), out_(out_of_service(rig, options.cameras)) {
    const std::optional<lf::FocusRange> range = lf::estimate_focus_range(rig, image_of_);
    distance_ = options.distance > 0 ? options.distance : range ? std::sqrt(range->near * range->far) : 1;
  }
  bool is_in_service(lf::CameraIndex camera) const { return !std::ranges::binary_search(out_, camera); }

  // Camera `camera` without itself and `others` (ascending). `picture` may be null.
  Row predict(lf::CameraIndex camera, const std::vector<size_t>& others, lf::Image* picture) {
    const lf::Camera& at = rig_.cameras[camera];
    lf::CameraSet without = out_;
    without.insert(without.end(), others.begin(), others.end());
    without.push_back(camera);
    std::ranges::sort(without);
    const lf::Mesh mesh = lf::build_mesh(rig_, without);
    lf::View view{.width = at.width, .height = at.height, .lens = at.lens, .pose = at.pose, .focus = {}};
    view.focus.plane = lf::focal_plane_at(view.pose, distance_);
    view.blending = options_.blending();
    const auto start = std::chrono::steady_clock::now();
    const lf::Still still = render(rig_, mesh, view, *renderer_, image_of_, options_);
    Row row{at.name.empty() ? "camera " + std::to_string(at.id) : at.name};
    row.ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    row.coverage = covered_fraction(still.coverage);
    row.fragments = static_cast<double>(still.fragments);
    row.fragment_bytes = static_cast<double>(still.fragment_bytes);
    row.quality = lf::compare(still.picture, images_.get(camera), still.coverage);
    if (picture) *picture = still.picture;
    return row;
  }

 private:
  const lf::Rig& rig_;
  const Options& options_;
  lf::StillImages images_;
  const lf::CameraSet out_;
  const lf::CameraImages image_of_ = [this](lf::CameraIndex camera) -> const lf::Image& { return images_.get(camera); };
  const std::unique_ptr<lf::FragmentRenderer> renderer_ = lf::make_scalar_renderer();
  double distance_;
};

// What the others predict badly has something wrong with its calibration, colour or focus, or sees what no other does.
void leave_one_out(const lf::Rig& rig, const Options& options) {
  Predictor predictor(rig, options);
  Progress progress("leaving out", rig.cameras.size());
  std::vector<Row> rows;
  std::vector<lf::CameraIndex> cameras;
  std::vector<double> psnr;
  for (lf::CameraIndex i = 0; i < rig.cameras.size(); i++, progress.step()) {
    if (!predictor.is_in_service(i)) continue;
    lf::Image picture;
    rows.push_back(predictor.predict(i, {}, &picture));
    if (rows.back().coverage > 0) lf::save_image(picture, options.out + "/" + rows.back().name + ".png");
    cameras.push_back(i);
    psnr.push_back(rows.back().quality->psnr_db);
  }
  progress.finish();
  print_table(rows);
  const auto predict = [&](size_t camera, std::vector<size_t> without) {
    for (size_t& other : without) other = cameras[other];
    return predictor.predict(cameras[camera], without, nullptr).quality->psnr_db;
  };
  for (const size_t i : lf::find_suspects(psnr, predict))
    std::printf("%s: %.1f dB is unusually low: look at its calibration, colour and focus.\n", rows[i].name.c_str(),
                psnr[i]);
  if (!options.json.empty()) write_json(rows, options.json);
}

void run(const Options& options) {
  lf::Rig rig = lf::load_rig(options.rig);
  if (options.every != 1) rig = lf::every_nth(rig, options.every);
  std::error_code error;
  std::filesystem::create_directories(options.out, error);
  if (error) throw lf::Error(options.out + ": can't be made: " + error.message());

  lf::validate(options.blending());
  if (options.leave_one_out) return leave_one_out(rig, options);
  std::vector<lf::NamedView> views = lf::load_views(options.views);
  for (lf::NamedView& view : views) view.view.blending = options.blending();
  const lf::Mesh mesh = lf::build_mesh(rig, out_of_service(rig, options.cameras));
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
    const lf::Still still = render(rig, mesh, view.view, *renderer, image_of, options);
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
  cli::App app("Renders stills of a light field from the images that its rig file names.", "lf-render");
  app.add_option("--rig", options.rig, "Rig file (rig.json)")->required();
  cli::Option* views = app.add_option("--views", options.views, "Views to render (views.json)");
  cli::Option* leave_one_out = app.add_flag(
      "--leave-one-out", options.leave_one_out,
      "In place of views: every camera is left out and predicted by the others; tells cameras with something wrong");
  views->excludes(leave_one_out);
  app.add_option("--out", options.out, "Folder for NAME.png of each view; made if it is not there")->required();
  app.add_option("--truth", options.truth, "Folder with NAME.png to compare with");
  app.add_option("--every", options.every, "Use rows and columns 0, N, 2N, ... of a grid");
  app.add_option("--cameras", options.cameras, "Ids of the cameras in service, such as 0-3,7 (default: all)");
  app.add_option("--json", options.json, "Write the table to this file as well");
  app.add_option("--focus", options.focus, "On what: a surface, found from the views' plane, or that plane")
      ->capture_default_str()
      ->check(cli::IsMember({"plane", "surface"}));
  app.add_option("--focus-near", options.surface.near, "Nearest that the surface can be, metres from the array");
  app.add_option("--focus-far", options.surface.far, "Farthest");
  app.add_option("--focus-distance", options.distance, "Of the cameras that are left out (default: estimated)");
  cli::Option* aperture = app.add_option(
      "--aperture", options.aperture, "Diameter of a synthetic aperture, metres (default: three cameras a pixel)");
  app.add_option("--nearest-cameras", options.nearest_cameras,
                 "Weigh as many cameras a pixel by angle, resolution and field of view, in place of three by the mesh")
      ->excludes(aperture);
  app.add_option("--resampling", options.resampling, "How images are sampled, as of lffragment")
      ->capture_default_str()
      ->check(cli::IsMember({"bilinear", "sharpened"}));
  app.add_flag("--i420", options.i420, "Render in YCbCr 4:2:0 as video sources would");
  return cli::run_tool(app, argc, argv, [&] {
    if (options.views.empty() && !options.leave_one_out) throw lf::Error("give --views or --leave-one-out");
    run(options);
  });
}
