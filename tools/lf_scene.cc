// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-scene: films the built-in scene with the cameras of any rig, and renders ground truth for any views.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/json_value.h"
#include "base/text.h"
#include "base/worker_pool.h"
#include "command_line.h"
#include "file_names.h"
#include "image/image.h"
#include "mjpeg_writer.h"
#include "progress.h"
#include "rig/rig.h"
#include "rig/rig_json.h"
#include "scene/calibration_targets.h"
#include "scene/scene.h"
#include "terminal.h"
#include "view/view_path.h"

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

struct FaultOptions {
  int seed = -1;
  std::string stuck;

  void add_to(cli::App& app) {
    cli::Option* faults =
        app.add_option("--faults", seed,
                       "Seed of random colour faults, which simulate uncalibrated cameras. The faults are brightness "
                       "errors of up to 8 %, white balance errors of up to 5 %, vignetting of up to 30 %, black level, "
                       "gamma, crosstalk and noise. The true values are written to colours.json")
            ->type_name("SEED")
            ->check(cli::Range(0, 1000000));
    app.add_option(
           "--stuck", stuck,
           "Ids of cameras that simulate a stuck exposure, for example 0-3,7. Their images are 1.6 times as bright")
        ->type_name("LIST")
        ->needs(faults);
  }
  std::vector<lf::ColourFault> faults(const lf::Rig& rig) const {
    if (seed < 0) return {};
    std::vector<lf::ColourFault> faults = lf::random_faults(rig.cameras.size(), static_cast<uint32_t>(seed));
    if (!stuck.empty())
      for (const lf::CameraIndex i : lf::parse_camera_list(rig, stuck)) faults[i].gain = lf::kStuckGain;
    return faults;
  }
};

lf::Image filmed(lf::Image image, const std::vector<lf::ColourFault>& faults, const lf::Rig& rig, size_t i, int n) {
  if (faults.empty()) return image;
  return lf::apply_fault(image, faults[i], rig.cameras[i].principal_point(),
                         (uint64_t{i} << 32) + static_cast<uint64_t>(n));
}

void write_faults(const lf::Rig& rig, const std::vector<lf::ColourFault>& faults, const std::string& folder) {
  if (!faults.empty()) lf::write_text_file(lf::faults_to_json(rig, faults), folder + "/colours.json");
}

struct ChartOptions {
  std::string rig, out;
  int places = 12, quality = 97;
  FaultOptions faults;
};

void film_chart(const ChartOptions& options) {
  lf::Rig rig = lf::load_rig(options.rig);
  const std::vector<lf::ColourFault> faults = options.faults.faults(rig);
  const std::vector<lf::ChartPose> charts = lf::colour_chart_poses(rig, options.places);
  lf::AtomicFolderUpdate update(options.out);
  Progress progress("filming", rig.cameras.size());
  for (size_t i = 0; i < rig.cameras.size(); i++, progress.step()) {
    lf::Camera& camera = rig.cameras[i];
    const bool fits = !camera.name.empty() && camera.name.find('/') == std::string::npos;
    const std::string name = (fits ? camera.name : "camera-" + std::to_string(camera.id)) + ".mkv";
    std::vector<lf::Image> frames(charts.size());
    lf::WorkerPool::shared()->run(8, charts.size(), [&](size_t n) {
      const lf::Image image = lf::render_chart({camera.width, camera.height, camera.lens, camera.pose}, charts[n]);
      frames[n] = filmed(image, faults, rig, i, static_cast<int>(n));
    });
    MjpegWriter writer((fs::path(update.staging()) / name).string(), camera.width, camera.height, {1, 1},
                       options.quality);
    for (const lf::Image& frame : frames) writer.add(frame);
    writer.finish();
    camera.source = name;
    camera.image.clear();
  }
  progress.finish();
  update.commit();
  write_faults(rig, faults, options.out);
  lf::save_rig(rig, options.out + "/rig.json");
  terminal::print("%zu cameras, a chart at %zu places: %s/rig.json\n", rig.cameras.size(), charts.size(),
                  options.out.c_str());
}

cli::App* add_chart_command(cli::App& app) {
  const auto o = std::make_shared<ChartOptions>();
  cli::App* command = app.add_subcommand("chart",
                                         "Films a colour chart with 24 patches at several positions in front of the "
                                         "array, as test material for lf-calibrate colour");
  command->add_option("--rig", o->rig, "Rig file of the cameras that film the chart")
      ->required()
      ->type_name("RIG.json");
  command->add_option("--out", o->out, "Folder that receives rig.json and a film for each camera")
      ->required()
      ->type_name("DIR");
  command
      ->add_option("--places", o->places,
                   "Number of positions of the chart. Each film has one frame per position, so more positions make "
                   "longer films")
      ->check(cli::Range(1, 1000));
  command->add_option("--quality", o->quality, "JPEG quality of the films")->check(cli::Range(1, 100));
  o->faults.add_to(*command);
  command->callback([o] { film_chart(*o); });
  return command;
}

using Step = std::function<void()>;

// Calls job(0, step) to job(count - 1, step) on `threads` threads, and shows their progress: the calls of `step`, in
// total `steps`. If a job throws, `step` ends all jobs.
void run_jobs(size_t count, int threads, size_t steps, const std::function<void(size_t, const Step&)>& job) {
  struct Stopped {};
  Progress progress("filming", steps);
  std::mutex mutex;
  std::atomic<bool> failed = false;
  const Step step = [&] {
    if (failed) throw Stopped();
    const std::lock_guard lock(mutex);
    progress.step();
  };
  lf::WorkerPool().run(static_cast<unsigned>(threads), count, [&](size_t i) {
    try {
      if (!failed) job(i, step);
    } catch (const Stopped&) {
    } catch (...) {
      failed = true;
      throw;
    }
  });
}

struct LightOptions {
  std::string rig, out;
  std::vector<std::string> framerates = {"30"}, seconds = {"20"};
  int quality = 95;
  int threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  lf::MovingLightOptions lights;
};

FrameRate parse_rate(const std::string& text) {
  FrameRate rate;
  int end = 0;
  double value;
  if (std::sscanf(text.c_str(), "%d/%d%n", &rate.numerator, &rate.denominator, &end) == 2 && text[end] == 0) {
    value = rate.denominator > 0 ? static_cast<double>(rate.numerator) / rate.denominator : 0;
  } else if (std::sscanf(text.c_str(), "%lf%n", &value, &end) == 1 && text[end] == 0 && std::isfinite(value)) {
    gst_util_double_to_fraction(value, &rate.numerator, &rate.denominator);
  } else {
    value = 0;
  }
  if (!(value >= 0.001 && value <= 1000))
    throw lf::Error("--framerate " + text + ": must be frames per second from 0.001 to 1000, such as 15 or 30000/1001");
  return rate;
}

double parse_seconds(const std::string& text) {
  int end = 0;
  double value = 0;
  if (std::sscanf(text.c_str(), "%lf%n", &value, &end) != 1 || text[end] != 0 || !(value > 0 && value <= 3600))
    throw lf::Error("--seconds " + text + ": must be a duration in seconds, more than 0 and at most 3600");
  return value;
}

struct LightFilm {
  FrameRate rate;
  int64_t frames;
};

// Returns the length of the film of camera `index`. The options apply to the cameras in turn.
LightFilm light_film(const LightOptions& options, size_t index) {
  const FrameRate rate = parse_rate(options.framerates[index % options.framerates.size()]);
  const double seconds = parse_seconds(options.seconds[index % options.seconds.size()]);
  return {rate, std::max<int64_t>(1, std::llround(seconds * rate.numerator / rate.denominator))};
}

// Writes the film of one camera. Returns the true positions of the lights in its frames.
json record(const LightOptions& options, const std::string& folder, const lf::LightTrajectory& path,
            const lf::Camera& camera, size_t index, const Step& step) {
  const auto [rate, frames] = light_film(options, index);
  const lf::MovingLightCamera lights(path, {camera.width, camera.height, camera.lens, camera.pose});
  MjpegWriter writer((fs::path(folder) / (camera.name + ".mkv")).string(), camera.width, camera.height, rate,
                     options.quality);
  json list = json::array();
  for (int64_t n = 0; n < frames; n++, step()) {
    const double stamp = static_cast<double>(n) * rate.denominator / rate.numerator;
    const double time = stamp + camera.time_offset;
    writer.add(lights.picture(time, index << 32 | static_cast<uint64_t>(n)));
    json frame = {stamp};
    const auto places = lights.places(time);
    for (int i = 0; i < path.num_lights(); i++)
      if (places[i]) frame.push_back({places[i]->x, places[i]->y, 1e-3, path.num_lights() - i});
    list.push_back(std::move(frame));
  }
  writer.finish();
  return {{"id", camera.id}, {"width", camera.width}, {"height", camera.height}, {"frames", std::move(list)}};
}

void film_lights(const LightOptions& options) {
  lf::Rig rig = lf::load_rig(options.rig);
  const lf::LightTrajectory path(rig, options.lights);
  check_file_names(rig);
  int64_t frames = 0;
  for (size_t i = 0; i < rig.cameras.size(); i++) frames += light_film(options, i).frames;
  lf::AtomicFolderUpdate update(options.out);
  std::vector<json> cameras(rig.cameras.size());
  run_jobs(cameras.size(), options.threads, static_cast<size_t>(frames), [&](size_t i, const Step& step) {
    cameras[i] = record(options, update.staging(), path, rig.cameras[i], i, step);
  });
  update.commit();
  const json truth = {
      {"format", "lightfield-tracks"}, {"version", 1}, {"bar", path.num_lights() == 2}, {"cameras", cameras}};
  lf::write_text_file(truth.dump() + "\n", (fs::path(options.out) / "lights.json").string());
  for (lf::Camera& camera : rig.cameras) camera.source = camera.name + ".mkv", camera.image.clear();
  const std::string rig_path = (fs::path(options.out) / "rig.json").string();
  lf::save_rig(rig, rig_path);
  terminal::print("%zu cameras, %lld frames: %s\n", rig.cameras.size(), static_cast<long long>(frames),
                  rig_path.c_str());
}

cli::App* add_lights_command(cli::App& app) {
  const auto o = std::make_shared<LightOptions>();
  cli::App* command =
      app.add_subcommand("lights",
                         "Films a light, or a bar with two lights, that moves through the dark, as test material for "
                         "lf-calibrate track. Writes the film DIR/NAME.mkv for each camera. The ground truth is in "
                         "DIR/rig.json, with the time offsets of RIG, and in DIR/lights.json");
  command->add_option("--rig", o->rig, "Rig file of the cameras to simulate")->required()->type_name("RIG.json");
  command->add_option("--out", o->out, "Folder to write")->required()->type_name("DIR");
  command->add_option("--bar", o->lights.bar, "Distance between two lights on a bar, in metres (0: one light)")
      ->check(cli::NonNegativeNumber);
  command
      ->add_option("--framerate", o->framerates,
                   "Frames per second, for example 30 or 30000/1001. Several comma-separated values apply to the "
                   "cameras in turn")
      ->delimiter(',');
  command
      ->add_option("--seconds", o->seconds,
                   "Length of the films, in seconds. Several comma-separated values apply to the cameras in turn")
      ->delimiter(',');
  command->add_option("--speed", o->lights.speed, "Speed of the lights, in metres per second")
      ->check(cli::PositiveNumber);
  command->add_option("--near", o->lights.near, "Minimum distance of the lights from the array, in metres");
  command->add_option("--far", o->lights.far, "Maximum distance of the lights from the array, in metres");
  command
      ->add_option("--power", o->lights.power,
                   "Brightness of a light at a distance of 1 m (1: its image just saturates)")
      ->check(cli::PositiveNumber);
  command
      ->add_option("--exposure", o->lights.exposure,
                   "Exposure time of each frame, in seconds. During longer exposures, the light draws longer streaks")
      ->check(cli::NonNegativeNumber);
  command->add_option("--noise", o->lights.noise, "Standard deviation of the image noise, in levels of 255")
      ->check(cli::NonNegativeNumber);
  command
      ->add_option("--ambient", o->lights.ambient,
                   "Ambient light as a fraction of the normal light of the scene (0: the room is completely dark)")
      ->check(cli::NonNegativeNumber);
  command
      ->add_option(
          "--reflection", o->lights.reflection,
          "Fraction of the light that a window behind the light reflects. Its reflections simulate false detections")
      ->capture_default_str()
      ->check(cli::Range(0.0, 1.0));
  command->add_option("--quality", o->quality, "JPEG quality of the films")->check(cli::Range(1, 100));
  command->add_option("--threads", o->threads)->check(cli::Range(1, 256));
  command->callback([o] { film_lights(*o); });
  return command;
}

struct Options {
  std::string out, rig, grid = "8x8", framerate = "15", format = "mjpeg", truth;
  int width = 320, height = 240, frames = 60, quality = 90, samples = 2;
  int threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  FaultOptions faults;
};

lf::Rig rig_of(const Options& options) {
  if (!options.rig.empty()) return lf::load_rig(options.rig);
  int rows, columns, end = 0;
  if (std::sscanf(options.grid.c_str(), "%dx%d%n", &rows, &columns, &end) != 2 || options.grid[end] != 0 || rows < 1 ||
      columns < 1)
    throw lf::Error("--grid " + options.grid + ": must be ROWSxCOLUMNS, such as 8x8, but at least 1x1");
  return lf::scene_rig(rows, columns, options.width, options.height);
}

std::string frame_name(const std::string& camera, int frame) {
  char number[16];
  std::snprintf(number, sizeof number, "_%04d.png", frame);
  return camera + number;
}

void film_camera(const Options& options, const fs::path& folder, const lf::Rig& rig, size_t index,
                 const std::vector<lf::ColourFault>& faults, FrameRate rate, const Step& step) {
  const lf::Camera& camera = rig.cameras[index];
  std::vector<double> times;
  for (int n = 0; n < options.frames; n++)
    times.push_back(static_cast<double>(n) * rate.denominator / rate.numerator + camera.time_offset);
  lf::SceneRenderer film({camera.width, camera.height, camera.lens, camera.pose}, std::move(times), options.samples);
  std::optional<MjpegWriter> writer;
  if (options.format == "mjpeg")
    writer.emplace((folder / (camera.name + ".mkv")).string(), camera.width, camera.height, rate, options.quality);
  for (int n = 0; n < options.frames; n++, step()) {
    const lf::Image image = filmed(film.next(), faults, rig, index, n);
    if (writer) writer->add(image);
    if (!writer || n == 0)
      lf::save_image(image, (folder / (writer ? camera.name + ".png" : frame_name(camera.name, n))).string());
  }
  if (writer) writer->finish();
}

// Frames that remain from an earlier, longer film would look like the end of the new film, so they are removed.
void remove_later_frames(const Options& options, const lf::Rig& rig) {
  for (const lf::Camera& camera : rig.cameras)
    for (int n = options.frames; fs::remove(fs::path(options.out) / frame_name(camera.name, n)); n++) {
    }
}

void film(const Options& options) {
  if (options.out.empty()) throw lf::Error("--out is missing: give the folder to write (see --help)");
  const lf::Rig rig = rig_of(options);
  const FrameRate rate = parse_rate(options.framerate);
  check_file_names(rig);
  std::set<std::string> view_names;
  std::vector<lf::NamedView> views;
  if (!options.truth.empty()) views = lf::load_views(options.truth);
  for (size_t i = 0; i < views.size(); i++)
    check_file_name(views[i].name, options.truth + ": views[" + std::to_string(i) + "].name", view_names);

  // Existing files are replaced only when the new film is complete. The rig file is written last, so that all files
  // that it names exist.
  const fs::path rig_path = fs::path(options.out) / "rig.json";
  lf::AtomicFolderUpdate update(options.out);
  if (!views.empty()) lf::make_folder(update.staging() + "/truth");

  const std::vector<lf::ColourFault> faults = options.faults.faults(rig);
  const size_t cameras = rig.cameras.size(), steps = cameras * static_cast<size_t>(options.frames) + views.size();
  run_jobs(cameras + views.size(), options.threads, steps, [&](size_t i, const Step& step) {
    const fs::path folder = update.staging();
    if (i < cameras) return film_camera(options, folder, rig, i, faults, rate, step);
    const auto& [name, time, view] = views[i - cameras];
    lf::save_image(lf::render_scene({view.width, view.height, view.lens, view.pose}, time, options.samples),
                   (folder / "truth" / (name + ".png")).string());
    step();
  });
  update.commit();
  if (options.format == "png") remove_later_frames(options, rig);

  lf::Rig filmed = rig;
  for (lf::Camera& camera : filmed.cameras) {
    const bool png = options.format == "png";
    camera.source = camera.name + (png ? "_%04d.png" : ".mkv");
    camera.image = png ? frame_name(camera.name, 0) : camera.name + ".png";
  }
  write_faults(rig, faults, options.out);
  lf::save_rig(filmed, rig_path.string());
  terminal::print("%zu cameras, %d frames at %s/s, %zu ground truth views: %s\n", rig.cameras.size(), options.frames,
                  options.framerate.c_str(), views.size(), rig_path.c_str());
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  cli::App app(
      "Films the built-in synthetic scene with a camera array, as test material with known ground truth. Writes "
      "DIR/rig.json and a film for each camera. The exact pictures of the views of --truth are written to DIR/truth.",
      "lf-scene");
  app.add_option("--out", o.out,
                 "Folder to write. It receives rig.json, the films and the ground truth. This option "
                 "is required")
      ->type_name("DIR");
  cli::Option* rig = app.add_option("--rig", o.rig, "Rig file of the cameras to simulate")->type_name("RIG.json");
  app.add_option("--grid", o.grid,
                 "Rows and columns of the built-in camera array, for example 8x8. This array is used without --rig")
      ->type_name("RxC")
      ->excludes(rig);
  app.add_option("--width", o.width, "Image width of the cameras in the built-in array, in pixels")->excludes(rig);
  app.add_option("--height", o.height, "Image height of the cameras in the built-in array, in pixels")->excludes(rig);
  app.add_option("--frames", o.frames)->check(cli::Range(1, 1000000));
  app.add_option("--framerate", o.framerate, "Frames per second, for example 15, 29.97 or 30000/1001");
  app.add_option("--format", o.format,
                 "Format of the films. mjpeg: a film NAME.mkv for each camera, and its first frame as NAME.png; png: "
                 "one file per frame, NAME_0000.png, NAME_0001.png, ...")
      ->check(cli::IsMember({"mjpeg", "png"}));
  const cli::Option* quality =
      app.add_option("--quality", o.quality, "JPEG quality of the films")->check(cli::Range(1, 100));
  app.add_option("--truth", o.truth,
                 "Views file. The exact picture of each of these views, at its time, is written to DIR/truth")
      ->type_name("VIEWS.json");
  app.add_option("--samples", o.samples,
                 "Number N of rays along x and y for each pixel that needs antialiasing, so N x N rays in total. More "
                 "rays give smoother edges")
      ->check(cli::Range(1, 16));
  app.add_option("--threads", o.threads)->check(cli::Range(1, 256));
  o.faults.add_to(app);
  app.require_subcommand(0, 1);
  cli::App *chart = add_chart_command(app), *lights = add_lights_command(app);
  for (cli::App* command : {chart, lights}) command->excludes_options_of(app);
  gst_init(nullptr, nullptr);
  return cli::run_tool(app, argc, argv, [&] {
    if (*quality && o.format == "png")
      throw lf::Error("--quality: applies only to --format mjpeg, because PNG is lossless");
    if (!*chart && !*lights) film(o);
  });
}
