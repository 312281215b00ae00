// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-calibrate intrinsics: one camera's lens and its covariance, from images of a checkerboard.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <gst/gst.h>
#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "base/text.h"
#include "board_recordings.h"
#include "calibration/intrinsics.h"
#include "commands.h"
#include "image/image.h"
#include "recordings.h"
#include "rig/rig_json.h"
#include "rig/source_security.h"
#include "terminal.h"

namespace {

using lf::IntrinsicsResult;
using nlohmann::ordered_json;

struct IntrinsicsArguments {
  std::vector<std::string> images;
  BoardOptions board;
  std::string model = "auto", rig, out, json;
  uint32_t camera = 0;
  int views = 20;
  bool trusted = false;
  const cli::Option* views_option = nullptr;
};

// Returns the source for a GStreamer URI such as file:///..., v4l2:///dev/video0 or rtsp://...
VideoSource video_of(const std::string& uri) {
  if (uri.find('"') != std::string::npos)
    throw lf::Error(uri + ": must not contain a quotation mark; write %22 instead");
  return {"uridecodebin uri=\"" + uri + "\" ! videoconvert ! videoflip video-direction=auto",
          lf::redacted_location(uri), uri.starts_with("file:")};
}

// Returns the source for a camera of a rig. lfcamsrc opens it with its image size and controls.
VideoSource video_of(const std::string& rig, uint32_t camera, bool trusted) {
  if (rig.find('"') != std::string::npos) throw lf::Error(rig + ": must not contain a quotation mark");
  const lf::Rig read = lf::load_rig(rig);
  const auto index = read.index_of_id(camera);
  if (!index) throw lf::Error(rig + ": has no camera " + std::to_string(camera));
  const std::string& source = read.cameras[*index].source;
  const std::string name = rig + ": camera " + std::to_string(camera);
  if (source.empty())
    throw lf::Error(
        name + ": has no source in the rig file, so it cannot be opened; give images or a video of the board instead");
  const bool file = !lf::is_launch_line(read, source) && (!lf::is_uri(source) || source.starts_with("file:"));
  return {"lfcamsrc rig=\"" + rig + "\" camera=" + std::to_string(camera) + (trusted ? " trusted=true" : ""), name,
          file};
}

struct Images {
  int width = 0, height = 0;
  std::vector<lf::BoardView> views;
  std::vector<std::string> without_board;
};

void check_size(Images& found, const lf::Image& image, const std::string& name) {
  if (found.width == 0) {
    found.width = image.width();
    found.height = image.height();
  }
  if (image.width() != found.width || image.height() != found.height)
    throw lf::Error(name + ": is " + std::to_string(image.width()) + "x" + std::to_string(image.height()) +
                    ", but the previous images are " + std::to_string(found.width) + "x" +
                    std::to_string(found.height));
}

// Collects views of the board from a video or a live camera. The board must not move for a moment in each view.
void watch(const IntrinsicsArguments& options, const lf::CalibrationBoard& board, const VideoSource& video,
           Images& found) {
  std::optional<lf::KeyframeSelector> chooser;
  int kept = 0, frame = 0;
  const auto use = [&](const VideoFrame& picture) {
    const lf::Image image = picture.rgb();
    check_size(found, image, video.name);
    if (!chooser) chooser.emplace(image.width());
    auto view = lf::find_board(image, board);
    if (view && chooser->take(*view)) {
      view->name = video.name + " frame " + std::to_string(frame);
      found.views.push_back(std::move(*view));
      terminal::print_error("view %d of %d\n", ++kept, options.views);
    }
    frame++;
    return kept < options.views;
  };
  try {
    for_each_video_frame(video, use);
  } catch (const lf::Error&) {
    if (found.width > 0) throw;
    throw lf::Error(
        video.name + ": no video could be read" +
        (video.waits
             ? ""
             : "; check that the camera is plugged in and that no other program uses it, or run lf-rig doctor"));
  }
  if (kept == 0) found.without_board.push_back(video.name);
}

Images find_boards(const IntrinsicsArguments& options, const lf::CalibrationBoard& board) {
  Images found;
  if (options.images.empty() && options.rig.empty())
    throw lf::Error("nothing to calibrate: give images or videos of the board, or --rig for a live camera");
  const auto is_video = [](const std::string& path) { return path.find("://") != std::string::npos; };
  if (*options.views_option && !options.images.empty() && std::ranges::none_of(options.images, is_video))
    throw lf::Error(
        "--views: cannot be used with image files, because all of them are used. The option limits the views from a "
        "video or a live camera");
  if (options.images.empty()) watch(options, board, video_of(options.rig, options.camera, options.trusted), found);
  for (const std::string& path : options.images) {
    if (is_video(path)) {
      watch(options, board, video_of(path), found);
      continue;
    }
    const lf::Image image = lf::load_image(path);
    check_size(found, image, path);
    if (auto view = lf::find_board(image, board)) {
      view->name = path;
      found.views.push_back(std::move(*view));
    } else {
      found.without_board.push_back(path);
    }
  }
  return found;
}

void print(const IntrinsicsResult& result, const Images& images) {
  for (const std::string& path : images.without_board) terminal::print("%s: no board found\n", path.c_str());
  for (const IntrinsicsResult::View& view : result.views)
    terminal::print("%s: %.3f px%s\n", view.name.c_str(), view.rms,
                    view.used ? "" : ": left out, because the view does not fit the lens");
  terminal::print("%-30s %8s %12s %10s %10s\n", "model", "rms px", "held out px", "parameters", "BIC");
  for (const IntrinsicsResult::Model& m : result.models)
    terminal::print("%-30s %8.4f %12.4f %10zu %10.1f%s\n", m.model.name().c_str(), m.rms, m.held_out_rms, m.num_params,
                    m.bic, m.model == result.fit.model ? "  <- chosen" : "");
  for (int i = 0; i < result.fit.lens.num_params(); i++)
    terminal::print("%-4s %12.6g +- %.2g\n", result.covariance.parameters[i].c_str(), result.fit.lens.params()[i],
                    std::sqrt(result.covariance.at(i, i)));
  for (const std::string& warning : result.warnings) terminal::print("warning: %s\n", warning.c_str());
}

ordered_json report(const IntrinsicsResult& result, const Images& images) {
  ordered_json views = ordered_json::array(), models = ordered_json::array(), parameters = ordered_json::object();
  for (const IntrinsicsResult::View& view : result.views)
    views.push_back({{"name", view.name}, {"rms_px", view.rms}, {"used", view.used}});
  for (const std::string& path : images.without_board) views.push_back({{"name", path}, {"used", false}});
  for (const IntrinsicsResult::Model& m : result.models)
    models.push_back({{"model", m.model.name()},
                      {"rms_px", m.rms},
                      {"held_out_rms_px", m.held_out_rms},
                      {"parameters", m.num_params},
                      {"bic", m.bic}});
  for (int i = 0; i < result.fit.lens.num_params(); i++)
    parameters[result.covariance.parameters[i]] = {{"value", result.fit.lens.params()[i]},
                                                   {"std", std::sqrt(result.covariance.at(i, i))}};
  return {{"model", result.fit.model.name()},
          {"rms_px", result.fit.rms},
          {"held_out_rms_px", result.held_out_rms},
          {"lens", parameters},
          {"views", views},
          {"models", models},
          {"warnings", result.warnings}};
}

// Saves the calibrated lens. The output is the rig of `--rig` with the new lens of this camera, or without `--rig` a
// rig with only this camera.
void save(const IntrinsicsArguments& options, const IntrinsicsResult& result, const Images& images) {
  lf::Rig rig;
  nlohmann::json original = {{"cameras", nlohmann::json::array()}};
  if (options.rig.empty()) {
    lf::Camera camera;
    camera.id = options.camera;
    camera.name = "cam_" + std::to_string(camera.id);
    camera.width = images.width;
    camera.height = images.height;
    rig.cameras.push_back(camera);
    original["cameras"].push_back({{"id", camera.id}});
  } else {
    rig = lf::load_rig(options.rig);
    original = lf::parse_json(lf::read_text_file(options.rig), options.rig);
  }
  const auto index = rig.index_of_id(options.camera);
  if (!index) throw lf::Error(options.rig + ": has no camera " + std::to_string(options.camera));
  lf::Camera& camera = rig.cameras[*index];
  if (camera.width != images.width || camera.height != images.height)
    throw lf::Error(
        options.rig + ": camera " + std::to_string(options.camera) +
        " has another image size in the rig than the given images. Use images of the size in the rig, not of " +
        std::to_string(images.width) + "x" + std::to_string(images.height));
  camera.lens = result.fit.lens;
  original["cameras"][*index]["covariance"] = lf::to_json(result.covariance);
  lf::rebase_paths(rig, std::filesystem::path(options.out).parent_path().string());
  lf::save_rig(rig, options.out, &original);
}

void calibrate(const IntrinsicsArguments& options) {
  gst_init(nullptr, nullptr);
  const lf::CalibrationBoard board = parse_board(options.board);
  lf::IntrinsicsOptions how;
  if (options.model != "auto") {
    how.lens = lf::lens_model_from_name(options.model);
    if (!how.lens)
      throw lf::Error("--model " + options.model +
                      ": is not a lens model of rig files. Give SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, "
                      "OPENCV, FULL_OPENCV, "
                      "OPENCV_FISHEYE or auto");
  }
  how.progress = [](const std::string& step) { terminal::print_error("%s\n", step.c_str()); };
  how.progress("searching for the board");
  const Images images = find_boards(options, board);
  if (images.views.empty()) throw lf::Error("no image shows the " + board.name() + ". " + advice_for(board));
  const IntrinsicsResult result = lf::calibrate_intrinsics(images.views, board, images.width, images.height, how);
  print(result, images);
  save(options, result, images);
  if (!options.json.empty()) lf::write_text_file(report(result, images).dump(1) + "\n", options.json);
}

}  // namespace

void add_intrinsics_command(cli::App& app) {
  const auto o = std::make_shared<IntrinsicsArguments>();
  cli::App* command = app.add_subcommand(
      "intrinsics",
      "Calibrates the lens of one camera, with its covariance, from images of a checkerboard or a ChArUco board");
  command->add_option(
      "IMAGES", o->images,
      "Images of the board, or URIs of videos. They should show the board at all distances, tilted to all sides and in "
      "all parts of the image. Without this argument, the live camera of --rig is used");
  o->views_option = command
                        ->add_option("--views", o->views,
                                     "Number of views of the board to keep from a video or a live camera. Hold the "
                                     "board still for a moment in each position")
                        ->check(cli::Range(3, 1000));
  add_board_options(*command, o->board);
  command->add_option(
      "--model", o->model,
      "Name of the lens model, as in rig files. auto: the model with the fewest parameters that fits the images");
  command->add_option("--rig", o->rig,
                      "Rig file that contains the camera. All other cameras are copied to --out unchanged (default: "
                      "--out becomes a rig with this camera only)");
  cli::add_trust_option(*command, o->trusted);
  command->add_option("--camera", o->camera, "Id of the camera to calibrate, as in the rig file of --rig")
      ->capture_default_str();
  command
      ->add_option("--out", o->out,
                   "Rig file to write, with the calibrated lens. This may be the "
                   "file of --rig")
      ->required();
  command->add_option("--json", o->json,
                      "JSON file that receives the report: the views, the models and the parameters");
  command->callback([o] { calibrate(*o); });
}
