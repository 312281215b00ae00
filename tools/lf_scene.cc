// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-scene: films the built-in scene with the cameras of any rig, and writes its ground truth for any views.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <functional>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "command_line.h"
#include "file_names.h"
#include "image/image.h"
#include "lf_scene_chart.h"
#include "lf_scene_lights.h"
#include "mjpeg_writer.h"
#include "progress.h"
#include "rig/rig_json.h"
#include "scene/scene.h"
#include "scene_faults.h"
#include "view/views_json.h"

namespace {

namespace fs = std::filesystem;

struct Options {
  std::string out, rig, grid = "8x8", framerate = "15", format = "mjpeg", truth;
  int width = 320, height = 240, frames = 60, quality = 90, samples = 2;
  int threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  FaultOptions faults;
};

lf::Rig rig_of(const Options& options) {
  if (!options.rig.empty()) return lf::load_rig(options.rig);
  int rows, columns, end = 0;
  if (std::sscanf(options.grid.c_str(), "%dx%d%n", &rows, &columns, &end) != 2 || options.grid[end] != 0)
    throw lf::Error("--grid " + options.grid + ": must be ROWSxCOLUMNS");
  return lf::scene_rig(rows, columns, options.width, options.height);
}

FrameRate rate_of(const std::string& text) {
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
    throw lf::Error("--framerate " + text + ": must be frames per second from 0.001 to 1000, as 15 or 30000/1001");
  return rate;
}

std::string frame_name(const std::string& camera, int frame) {
  char number[16];
  std::snprintf(number, sizeof number, "_%04d.png", frame);
  return camera + number;
}

// What is to be done; `step` is called after each picture.
using Step = std::function<void()>;
using Job = std::function<void(const Step& step)>;

Job film_job(const Options& options, const std::string& folder_path, const lf::Rig& rig, size_t index,
             const std::vector<lf::ColourFault>& faults, FrameRate rate) {
  const lf::Camera& camera = rig.cameras[index];
  const lf::SceneCamera lens{camera.width, camera.height, camera.lens, camera.pose};
  const auto frame = [=, &rig, &faults, offset = camera.time_offset](lf::SceneFilm& film, int n) {
    // A stamp is short of the true capture time by the camera's offset.
    const double time = static_cast<double>(n) * rate.denominator / rate.numerator + offset;
    return filmed(film.at(time), faults, rig, index, n);
  };
  const fs::path folder = folder_path;
  const std::string name = camera.name;
  const int frames = options.frames, samples = options.samples;
  if (options.format == "png")
    return [=](const Step& step) {
      lf::SceneFilm film(lens, samples);
      for (int n = 0; n < frames; n++, step()) lf::save_image(frame(film, n), (folder / frame_name(name, n)).string());
    };
  return [=, quality = options.quality](const Step& step) {
    lf::SceneFilm film(lens, samples);
    MjpegWriter writer((folder / (name + ".mkv")).string(), lens.width, lens.height, rate, quality);
    for (int n = 0; n < frames; n++, step()) {
      const lf::Image image = frame(film, n);
      // A still beside the film, for tools that render without a stream.
      if (n == 0) lf::save_image(image, (folder / (name + ".png")).string());
      writer.add(image);
    }
    writer.finish();
  };
}

Job truth_job(const Options& options, const std::string& folder, const lf::NamedView& view) {
  const fs::path path = fs::path(folder) / "truth" / (view.name + ".png");
  return [=, samples = options.samples](const Step& step) {
    const lf::SceneCamera camera{view.view.width, view.view.height, view.view.lens, view.view.pose};
    lf::save_image(lf::render_scene(camera, view.time, samples), path.string());
    step();
  };
}

// Frames of a longer film that was in the folder before would be taken for the end of this one.
void remove_later_frames(const Options& options, const lf::Rig& rig) {
  for (const lf::Camera& camera : rig.cameras)
    for (int n = options.frames; fs::remove(fs::path(options.out) / frame_name(camera.name, n)); n++) {
    }
}

// Runs the jobs on threads; the first error ends them all.
void run_jobs(const std::vector<Job>& jobs, int threads, Progress& progress) {
  std::atomic<size_t> next = 0;
  std::mutex mutex;
  std::exception_ptr error;
  std::atomic<bool> failed = false;
  struct Stopped {};
  const Step step = [&] {
    if (failed) throw Stopped();
    const std::lock_guard lock(mutex);
    progress.step();
  };
  const auto work = [&] {
    try {
      for (size_t i; !failed && (i = next++) < jobs.size();) jobs[i](step);
    } catch (const Stopped&) {
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (!failed.exchange(true)) error = std::current_exception();
    }
  };
  std::vector<std::thread> pool;
  for (int i = 1; i < threads; i++) pool.emplace_back(work);
  work();
  for (std::thread& thread : pool) thread.join();
  progress.finish();
  if (error) std::rethrow_exception(error);
}

void film(const Options& options) {
  if (options.out.empty()) throw lf::Error("--out is required (see --help)");
  const lf::Rig rig = rig_of(options);
  const FrameRate rate = rate_of(options.framerate);
  check_file_names(rig);
  std::set<std::string> view_names;
  std::vector<lf::NamedView> views;
  if (!options.truth.empty()) views = lf::load_views(options.truth);
  for (size_t i = 0; i < views.size(); i++)
    check_file_name(views[i].name, options.truth + ": views[" + std::to_string(i) + "].name", view_names);

  // What the folder has stays until the new film is complete. The rig file comes last: all that it names is there.
  const fs::path rig_path = fs::path(options.out) / "rig.json";
  lf::FolderUpdate update(options.out);
  if (!views.empty()) fs::create_directory(fs::path(update.staging()) / "truth");

  std::vector<Job> jobs;
  const std::vector<lf::ColourFault> faults = options.faults.faults(rig);
  for (size_t i = 0; i < rig.cameras.size(); i++)
    jobs.push_back(film_job(options, update.staging(), rig, i, faults, rate));
  for (const lf::NamedView& view : views) jobs.push_back(truth_job(options, update.staging(), view));
  Progress progress("filming", rig.cameras.size() * static_cast<size_t>(options.frames) + views.size());
  run_jobs(jobs, options.threads, progress);
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
  std::printf("%zu cameras, %d frames at %s/s, %zu ground truth views: %s\n", rig.cameras.size(), options.frames,
              options.framerate.c_str(), views.size(), rig_path.c_str());
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  cli::App app("Films the built-in scene: DIR/rig.json and a file per camera, in DIR/truth the ground truth of views.",
               "lf-scene");
  app.add_option("--out", o.out, "folder to write to; required")->type_name("DIR");
  cli::Option* rig = app.add_option("--rig", o.rig, "film with the cameras of this rig")->type_name("RIG.json");
  app.add_option("--grid", o.grid, "film with the scene's own array")
      ->type_name("RxC")
      ->capture_default_str()
      ->excludes(rig);
  app.add_option("--width", o.width, "of its cameras, pixels")->capture_default_str()->excludes(rig);
  app.add_option("--height", o.height, "of its cameras, pixels")->capture_default_str()->excludes(rig);
  app.add_option("--frames", o.frames)->capture_default_str()->check(cli::Range(1, 1000000));
  app.add_option("--framerate", o.framerate, "frames per second: 15, 29.97, 30000/1001")->capture_default_str();
  app.add_option("--format", o.format, "mjpeg: NAME.mkv and its first frame, NAME.png; png: NAME_0000.png, ...")
      ->capture_default_str()
      ->check(cli::IsMember({"mjpeg", "png"}));
  const cli::Option* quality =
      app.add_option("--quality", o.quality, "of JPEG")->capture_default_str()->check(cli::Range(1, 100));
  app.add_option("--truth", o.truth, "write the ground truth of these views at their times")->type_name("VIEWS.json");
  app.add_option("--samples", o.samples, "N x N rays per pixel where one is too few")
      ->capture_default_str()
      ->check(cli::Range(1, 16));
  app.add_option("--threads", o.threads)->capture_default_str()->check(cli::Range(1, 256));
  o.faults.add_to(app);
  app.require_subcommand(0, 1);
  cli::App *chart = add_chart_command(app), *lights = add_lights_command(app);
  for (cli::App* command : {chart, lights}) command->excludes_options_of(app);
  gst_init(nullptr, nullptr);
  return cli::run_tool(app, argc, argv, [&] {
    if (*quality && o.format == "png") throw lf::Error("--quality: of --format mjpeg");
    if (!*chart && !*lights) film(o);
  });
}
