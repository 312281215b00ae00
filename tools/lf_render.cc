// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-render: renders still views of a rig with images, without GStreamer.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <map>
#include <optional>
#include <ranges>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/json_value.h"
#include "base/text.h"
#include "command_line.h"
#include "composite/still.h"
#include "depth_progress.h"
#include "file_names.h"
#include "focus/still_focus.h"
#include "image/image.h"
#include "image/image_filters.h"
#include "node/renderer_selector.h"
#include "progress.h"
#include "quality/camera_monitor.h"
#include "quality/image_quality.h"
#include "render/focus_range.h"
#include "rig/rig_json.h"
#include "rig/still_image_cache.h"
#include "terminal.h"
#include "view/surface_files.h"
#include "view/view_path.h"

namespace {

struct QualityRow {
  std::string name;
  std::optional<lf::Quality> quality;
  double coverage = 0;
  double cameras = 0;
  double ms = 0;
};

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
  terminal::print("%-*s", name_width, row.name.c_str());
  if (row.quality)
    terminal::print("  %8.3f  %7.5f  %9d", row.quality->psnr_db, row.quality->ssim, row.quality->max_error);
  else
    terminal::print("  %8s  %7s  %9s", "-", "-", "-");
  terminal::print("  %8.4f  %7.4g  %8.1f\n", row.coverage, row.cameras, row.ms);
}

nlohmann::ordered_json to_json(const QualityRow& row) {
  nlohmann::ordered_json json;
  const auto count = [](double v) {
    return v == std::floor(v) ? nlohmann::ordered_json(static_cast<uint64_t>(v)) : nlohmann::ordered_json(v);
  };
  json["name"] = row.name;
  json["psnr_db"] = row.quality ? row.quality->psnr_db : NAN;
  json["ssim"] = row.quality ? row.quality->ssim : NAN;
  json["max_error"] = row.quality ? nlohmann::ordered_json(row.quality->max_error) : nullptr;
  json["coverage"] = row.coverage;
  json["cameras"] = count(row.cameras);
  json["ms"] = row.ms;
  return json;
}

void print_table(const std::vector<QualityRow>& rows) {
  size_t width = 4;
  for (const QualityRow& row : rows) width = std::max(width, row.name.size());
  const int name_width = static_cast<int>(width);
  terminal::print("%-*s  %8s  %7s  %9s  %8s  %7s  %8s\n", name_width, "view", "psnr_db", "ssim", "max_error",
                  "coverage", "cameras", "ms");
  for (const QualityRow& row : rows) print_row(row, name_width);
  print_row(mean_of(rows), name_width);
}

// Writes {"views": [{"name", "psnr_db", "ssim", "max_error", "coverage", "cameras", "ms"}, ...], "mean": {...}}. JSON
// has no infinity, so the PSNR of identical images (max_error 0) is null, as without ground truth (NAN). Throws
// lf::Error that names the file.
void write_json(const std::vector<QualityRow>& rows, const std::string& path) {
  nlohmann::ordered_json json;
  json["views"] = nlohmann::ordered_json::array();
  for (const QualityRow& row : rows) json["views"].push_back(to_json(row));
  json["mean"] = to_json(mean_of(rows));
  json["mean"].erase("name");
  lf::write_text_file(json.dump(1) + "\n", path);
}

struct Options {
  std::string rig, views, out, truth, cameras, json;
  int every = 1;
  double distance = 0;  // distance of the focal plane, metres
  bool i420 = false, leave_one_out = false, depth = false, ply = false, gltf = false;
  std::string focus = "surface", resampling = "sharpened", gains = "auto", renderer = "cpu";
  double aperture = 0;  // metres
  int nearest_cameras = 0;
  lf::DepthEstimator::Settings surface{.mode = lf::FocusMode::kSurface};

  lf::Blending blending() const { return lf::make_blending(aperture, nearest_cameras); }
  lf::Resampling sampled() const {
    return resampling == "bilinear" ? lf::Resampling::kBilinear : lf::Resampling::kSharpened;
  }
};

double covered_fraction(const std::vector<float>& coverage) {
  size_t covered = 0;
  for (const float c : coverage) covered += c > lf::kMinCoverage;
  return static_cast<double>(covered) / static_cast<double>(coverage.size());
}

lf::CameraSet out_of_service(const lf::Rig& rig, const std::string& list) {
  lf::CameraSet out;
  const auto all = std::views::iota(lf::CameraIndex{0}, static_cast<lf::CameraIndex>(rig.cameras.size()));
  std::ranges::set_difference(all, lf::parse_camera_list(rig, list), std::back_inserter(out));
  return out;
}

struct Rendered {
  QualityRow row;
  lf::View focused;
  lf::Image rgb;
  std::vector<float> coverage;
  std::shared_ptr<const lf::FocalMap> confidence;  // of the depths
};

lf::Quality quality_against(const Rendered& out, const std::string& truth_file) {
  const lf::Image truth = lf::load_image(truth_file);
  if (truth.width() != out.rgb.width() || truth.height() != out.rgb.height())
    throw lf::Error(truth_file + ": has " + lf::size_text(truth.width(), truth.height()) +
                    " pixels, but the view has " + lf::size_text(out.rgb.width(), out.rgb.height()));
  return lf::compare(out.rgb, truth, out.coverage);
}

class Renderer {
 public:
  Renderer(const lf::Rig& rig, const Options& options)
      : rig_(rig), options_(options), images_(rig, options.i420 ? lf::PixelFamily::kI420 : lf::PixelFamily::kRgb) {}

  // Estimates the depths of the cameras, if the focal surfaces need them. --leave-one-out does not use these depths,
  // because the cameras would have to be compared again for each view.
  void estimate_depths(const lf::CameraSet& cameras, std::span<const lf::View> views) {
    if (options_.focus == "plane") return;
    depths_ = estimate_depths_with_progress(rig_, cameras, views, image_of_, options_.surface);
  }
  // Adds a focal surface (the depth of each pixel) to the view if the option --focus surface is set. Exposure gains are
  // not compensated for --leave-one-out, which compares the cameras with each other.
  lf::View focused(const lf::Mesh& mesh, const lf::View& view) {
    gains_ = {};
    confidence_ = nullptr;
    if (options_.focus == "plane") return view;
    const bool match =
        !options_.leave_one_out && (options_.gains == "on" || (options_.gains == "auto" && !rig_.has_colour()));
    lf::ExposureCompensation gains;
    const int rounds = match ? lf::kMatchedRounds : lf::kSettledRounds;
    const lf::View focused = lf::focus_still(rig_, mesh, view, image_of_, options_.surface, rounds,
                                             match ? &gains : nullptr, depths_ ? &*depths_ : nullptr, &confidence_);
    gains_ = gains;
    return focused;
  }
  Rendered render(const std::string& name, const lf::Mesh& mesh, const lf::View& view) {
    reading_ = 0;
    const Clock::time_point start = Clock::now();
    Rendered out = still(name, mesh, focused(mesh, view));
    out.row.ms = ms_since(start) - reading_;
    out.confidence = confidence_;
    return out;
  }
  Rendered still(const std::string& name, const lf::Mesh& mesh, const lf::View& focused) {
    lf::RenderedAnswer answer{.pixels = static_cast<size_t>(focused.width) * focused.height};
    const std::shared_ptr<lf::gl::GlesRenderer> gpu = gpu_renderer();
    const Clock::time_point start = Clock::now();
    const double read_before = reading_;
    lf::Still still = lf::render_still(rig_, mesh, focused, image_of_, options_.sampled(), {}, gpu.get(),
                                       depths_ ? &*depths_ : nullptr);
    answer.drawing = still.drawing;
    answer.render_ns = static_cast<uint64_t>(1e6 * (ms_since(start) - (reading_ - read_before)));
    gpu_.rendered(choice_, answer);
    Rendered out{
        .row{name}, .focused = focused, .rgb = in_rgb(std::move(still.picture)), .coverage = std::move(still.coverage)};
    out.row.coverage = covered_fraction(out.coverage);
    out.row.cameras = static_cast<double>(still.cameras.size());
    return out;
  }
  const lf::Image& rgb_of(lf::CameraIndex camera) { return rgb_ = in_rgb(images_.get(camera)); }

 private:
  using Clock = std::chrono::steady_clock;
  static double ms_since(Clock::time_point start) {
    return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
  }
  static lf::Image in_rgb(lf::Image image) {
    return image.family() == lf::PixelFamily::kI420 ? lf::to_rgb(image) : std::move(image);
  }
  std::shared_ptr<lf::gl::GlesRenderer> gpu_renderer() {
    std::string warning;
    std::shared_ptr<lf::gl::GlesRenderer> gpu = gpu_.open(choice_, warning);
    if (!warning.empty()) terminal::print_error("lf-render: %s\n", warning.c_str());
    return gpu;
  }
  const lf::Image& read(lf::CameraIndex camera) {
    const Clock::time_point start = Clock::now();
    const lf::Image& image = images_.get(camera);
    reading_ += ms_since(start);
    const float gain = gains_.of(camera);
    if (std::abs(gain - 1) < lf::kGainTolerance) return image;
    matched_ = image;
    lf::ByteBuffer memory;
    lf::divide_by_gain(image.view(), {0, 0, image.width(), image.height()}, gain, memory);
    std::ranges::copy(memory, matched_.data().begin());
    return matched_;
  }

  const lf::Rig& rig_;
  const Options& options_;
  const lf::RendererChoice choice_ = *lf::renderer_choice(options_.renderer);
  lf::RendererSelector gpu_;
  lf::StillImageCache images_;
  lf::Image rgb_, matched_;
  std::optional<lf::ArrayDepth> depths_;
  std::shared_ptr<const lf::FocalMap> confidence_;  // of the depths of the current view
  lf::ExposureCompensation gains_;  // exposure gains of the current view; images are divided by their gain
  double reading_ = 0;              // time to read images of the current view, milliseconds
  const lf::CameraImages image_of_ = [this](lf::CameraIndex camera) -> const lf::Image& { return read(camera); };
};

// Renders each camera from all other cameras, like the camera monitor of a running array, and compares the result with
// the camera's image.
class Predictor {
 public:
  Predictor(const lf::Rig& rig, const Options& options)
      : rig_(rig), options_(options), renderer_(rig, options), out_(out_of_service(rig, options.cameras)) {
    const std::optional<lf::FocusRange> range = lf::estimate_focus_range(
        rig, [this](lf::CameraIndex camera) -> const lf::Image& { return renderer_.rgb_of(camera); });
    distance_ = options.distance > 0 ? options.distance : range ? std::sqrt(range->near * range->far) : 1;
  }
  bool is_in_service(lf::CameraIndex camera) const { return !std::ranges::binary_search(out_, camera); }

  Rendered predict(lf::CameraIndex camera) {
    Rendered out = renderer_.render(name_of(camera), lf::build_mesh(rig_, with(out_, camera)), view_of(camera));
    out.row.quality = lf::compare(out.rgb, renderer_.rgb_of(camera), out.coverage);
    focused_.insert_or_assign(camera, out.focused);
    return out;
  }

  // Returns the verdict of the camera monitor. Call this after all cameras in service have been predicted.
  lf::CameraMonitor watch() {
    lf::CameraMonitor monitor(rig_);
    const size_t most = kMaxTurns * rig_.cameras.size();
    for (auto camera = monitor.next(out_); camera && monitor.turns() < most; camera = monitor.next(out_)) {
      lf::CameraSet without;
      std::ranges::set_union(out_, monitor.suspected(), std::back_inserter(without));
      // A faulty camera also disturbs the focus of other views, so the views are focused again without the camera.
      const lf::View focused = monitor.suspects().empty()
                                   ? focused_.at(*camera)
                                   : renderer_.focused(lf::build_mesh(rig_, with(without, *camera)), view_of(*camera));
      const lf::CameraProbe probe = lf::make_probe(rig_, *camera, focused, without);
      monitor.take(*camera, lf::compare_prediction(picture(probe.predicted), picture(probe.seen)));
      if (monitor.is_settled()) break;
    }
    return monitor;
  }
  std::string name_of(lf::CameraIndex camera) const {
    const lf::Camera& at = rig_.cameras[camera];
    return at.name.empty() ? "camera " + std::to_string(at.id) : at.name;
  }

 private:
  static constexpr size_t kMaxTurns = 10;

  static lf::CameraSet with(lf::CameraSet cameras, lf::CameraIndex camera) {
    const auto place = std::ranges::lower_bound(cameras, camera);
    if (place == cameras.end() || *place != camera) cameras.insert(place, camera);
    return cameras;
  }
  lf::View view_of(lf::CameraIndex camera) const {
    const lf::Camera& at = rig_.cameras[camera];
    lf::View view{.width = at.width, .height = at.height, .lens = at.lens, .pose = at.pose, .focus = {}};
    view.focus.plane = lf::focal_plane_at(view.pose, distance_);
    view.blending = options_.blending();
    return view;
  }
  lf::CoverageImage picture(const lf::ViewRequest& request) {
    Rendered out = renderer_.still("", lf::build_mesh(rig_, request.out_of_service), lf::displayed_view(request));
    return {std::move(out.rgb), std::move(out.coverage)};
  }

  const lf::Rig& rig_;
  const Options& options_;
  Renderer renderer_;
  const lf::CameraSet out_;
  double distance_;
  std::map<lf::CameraIndex, lf::View> focused_;
};

// Checks the cameras: predicts the image of each camera from its neighbours and reports the errors. A bad prediction
// means a wrong calibration, colour or focus, or that the camera sees something that no other camera sees.
void leave_one_out(const lf::Rig& rig, const Options& options) {
  Predictor predictor(rig, options);
  Progress progress("leaving out", rig.cameras.size());
  std::vector<QualityRow> rows;
  std::vector<std::string> names;
  for (lf::CameraIndex i = 0; i < rig.cameras.size(); i++) names.push_back(predictor.name_of(i));
  const std::vector<std::string> files = flat_file_names(names);
  for (lf::CameraIndex i = 0; i < rig.cameras.size(); i++, progress.step()) {
    if (!predictor.is_in_service(i)) continue;
    const Rendered out = predictor.predict(i);
    if (out.row.coverage > 0) lf::save_image(out.rgb, options.out + "/" + files[i] + ".png");
    rows.push_back(out.row);
  }
  progress.finish();
  print_table(rows);
  const lf::CameraMonitor monitor = predictor.watch();
  for (const auto& [camera, fault] : monitor.suspects()) {
    using Fault = lf::CameraMonitor::Fault;
    terminal::print("%s stands out (%.1f dB): it %s\n", predictor.name_of(camera).c_str(),
                    monitor.error(camera).psnr_db,
                    fault == Fault::kColour ? "is brighter or darker than the rest of the array"
                    : fault == Fault::kDirection
                        ? "has another direction than the rig file states"
                        : "is out of focus, dirty or covered, or it sees something that no other camera sees");
  }
  if (!options.json.empty()) write_json(rows, options.json);
}

// `path` is the path of the files without their extension.
void save_depths(const Rendered& rendered, const Options& options, const std::string& path) {
  const lf::DepthImage depth = lf::depth_image(rendered.focused, rendered.coverage);
  if (options.depth) {
    lf::save_depth_png(depth, path + ".depth.png");
    lf::save_depth_pfm(depth, path + ".depth.pfm");
    lf::save_confidence_png(rendered.confidence.get(), depth.width, depth.height, path + ".confidence.png");
  }
  if (options.ply) lf::save_ply(lf::point_cloud(rendered.focused, depth, rendered.rgb.view()), path + ".ply");
  if (options.gltf)
    lf::save_gltf(rendered.focused, lf::surface_mesh(rendered.focused, rendered.coverage), rendered.rgb, path + ".glb");
}

void run(const Options& options) {
  lf::Rig rig = lf::load_rig(options.rig);
  if (options.every != 1) rig = lf::subsample_grid(rig, options.every);
  if (const std::string notice = lf::orientation_notice(rig); !notice.empty())
    terminal::print_error("warning: %s\n", notice.c_str());
  lf::make_folder(options.out);

  lf::validate(options.blending());
  if (options.leave_one_out) return leave_one_out(rig, options);
  std::vector<lf::NamedView> views = lf::load_views(options.views);
  std::vector<lf::View> wanted;
  for (lf::NamedView& view : views) {
    view.view.blending = options.blending();
    wanted.push_back(view.view);
  }
  const lf::CameraSet out = out_of_service(rig, options.cameras);
  const lf::Mesh mesh = lf::build_mesh(rig, out);
  Renderer renderer(rig, options);
  renderer.estimate_depths(lf::parse_camera_list(rig, options.cameras), wanted);
  Progress progress("rendering", views.size());
  std::vector<QualityRow> rows;
  for (const lf::NamedView& view : views) {
    Rendered out = renderer.render(view.name, mesh, view.view);
    if (!options.truth.empty()) out.row.quality = quality_against(out, options.truth + "/" + view.name + ".png");
    lf::save_image(out.rgb, options.out + "/" + view.name + ".png");
    if (options.depth || options.ply || options.gltf) save_depths(out, options, options.out + "/" + view.name);
    rows.push_back(out.row);
    progress.step();
  }
  progress.finish();
  print_table(rows);
  if (!options.json.empty()) write_json(rows, options.json);
}

// Returns the option --leave-one-out.
cli::Option* add_file_options(cli::App& app, Options& options) {
  app.add_option("--rig", options.rig, "Rig file (rig.json) with one still image per camera")->required();
  cli::Option* views = app.add_option("--views", options.views, "Views file (views.json) with the views to render");
  cli::Option* leave_one_out = app.add_flag(
      "--leave-one-out", options.leave_one_out,
      "Check the cameras instead of rendering views. Each camera image is rendered from the remaining cameras and "
      "compared with the real image. Cameras with unusually large differences are reported as faulty");
  views->excludes(leave_one_out);
  app.add_option("--out", options.out, "Folder that receives NAME.png for each view. It is created if necessary")
      ->required();
  app.add_flag("--depth", options.depth,
               "Also write the depth of each pixel, as NAME.depth.png (16 bits, in millimetres) and NAME.depth.pfm "
               "(floating point, in metres). Depths are along the optical axis of the view; 0 means unknown. "
               "NAME.confidence.png has their confidence, from 0 (a guess) to 255")
      ->excludes(leave_one_out);
  app.add_flag("--ply", options.ply,
               "Also write the points of the surface with their colours as NAME.ply, in metres and in the coordinates "
               "of the rig. Pixels at depth edges are left out")
      ->excludes(leave_one_out);
  app.add_flag("--gltf", options.gltf,
               "Also write the surface as NAME.glb, a file of glTF 2.0: triangles with the picture as texture, and a "
               "camera at the view. The surface is cut at depth edges")
      ->excludes(leave_one_out);
  app.add_option("--truth", options.truth,
                 "Folder with the expected picture of each view as NAME.png, for example from lf-scene --truth. The "
                 "table then contains the PSNR and the SSIM of each view")
      ->excludes(leave_one_out);
  app.add_option("--every", options.every,
                 "Use only every N-th row and column of a grid, starting with row and column 0. For example, 2 shows "
                 "the quality of an array with a quarter of the cameras");
  app.add_option("--cameras", options.cameras,
                 "Ids of the cameras to use, for example 0-3,7. All other cameras are treated as out of service "
                 "(default: all cameras)");
  app.add_option("--json", options.json, "JSON file that receives the results, in addition to the printed table");
  return leave_one_out;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  cli::App app("Renders stills of a light field from the images that its rig file names.", "lf-render");
  cli::Option* leave_one_out = add_file_options(app, options);
  app.add_option("--focus", options.focus,
                 "Focus of the views. plane: only the focal plane of each view is in focus. surface: the depth of each "
                 "pixel is estimated, so that the whole picture is in focus")
      ->check(cli::IsMember({"plane", "surface"}));
  cli::Option* focus_near =
      app.add_option("--focus-near", options.surface.near,
                     "Minimum distance of objects from the array, in metres, for the depth estimation of --focus "
                     "surface (default: estimated from the images)")
          ->check(cli::NonNegativeNumber);
  cli::Option* focus_far =
      app.add_option("--focus-far", options.surface.far,
                     "Maximum distance of objects from the array, in metres, for the depth estimation of --focus "
                     "surface (default: estimated from the images)")
          ->check(cli::NonNegativeNumber);
  app.add_option("--focus-distance", options.distance,
                 "Distance of the focal plane for --leave-one-out, in metres (default: estimated from the images)")
      ->check(cli::PositiveNumber)
      ->needs(leave_one_out);
  cli::Option* aperture =
      app.add_option("--aperture", options.aperture,
                     "Diameter of a synthetic aperture, in metres. All cameras within the aperture contribute to a "
                     "pixel. With --focus plane, objects out of focus blur as with a large lens (default: the three "
                     "cameras around the line of sight contribute)");
  app.add_option(
         "--nearest-cameras", options.nearest_cameras,
         "Number of cameras that contribute to a pixel. The cameras with the most similar angle, resolution and field "
         "of view are selected. Use this for irregular arrays (default: the three cameras around the line of sight)")
      ->excludes(aperture);
  app.add_option("--resampling", options.resampling,
                 "Interpolation of the camera images between pixel positions. sharpened restores most of the detail "
                 "that bilinear interpolation loses, but takes more time")
      ->check(cli::IsMember({"bilinear", "sharpened"}));
  cli::Option* gains = app.add_option("--gains", options.gains,
                                      "Exposure compensation, which matches the brightness of each camera to the rest "
                                      "of the array. It has an effect only with --focus surface (auto: on unless the "
                                      "rig has colour models)")
                           ->check(cli::IsMember({"auto", "on", "off"}))
                           ->excludes(leave_one_out);
  app.add_option("--renderer", options.renderer,
                 "Processor that renders the views. cpu: the CPU, with vector instructions. gl: a GPU, through OpenGL "
                 "ES. auto: the faster of the two on this machine")
      ->check(cli::IsMember({"cpu", "gl", "auto"}));
  app.add_flag("--i420", options.i420,
               "Convert the images to YCbCr 4:2:0 before rendering. The results are then the same as with video "
               "sources, which deliver this format");
  return cli::run_tool(app, argc, argv, [&] {
    if (options.views.empty() && !options.leave_one_out)
      throw lf::Error("nothing to do: give --views or --leave-one-out");
    if (options.focus == "plane")
      for (const auto& [option, name] :
           {std::pair(focus_near, "--focus-near"), {focus_far, "--focus-far"}, {gains, "--gains"}})
        if (*option)
          throw lf::Error(std::string(name) + ": has no effect with --focus plane; omit it, or use --focus surface");
    if (options.surface.far > 0 && options.surface.near >= options.surface.far)
      throw lf::Error("--focus-near: must be less than --focus-far");
    run(options);
  });
}
