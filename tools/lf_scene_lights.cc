// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-scene lights: what cameras record while a light, or a bar with two, is moved through the dark.
#include "lf_scene_lights.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/file.h"
#include "base/json_value.h"
#include "base/worker_pool.h"
#include "file_names.h"
#include "mjpeg_writer.h"
#include "progress.h"
#include "rig/rig_json.h"
#include "scene/lights.h"

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

struct LightOptions {
  std::string rig, out;
  std::vector<std::string> framerates = {"30"}, seconds = {"20"};
  int quality = 95;
  int threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  lf::LightsOptions lights;
};

FrameRate parse_rate(const std::string& text) {
  FrameRate rate{0, 1};
  int end = 0;
  const int fields = std::sscanf(text.c_str(), "%d%n/%d%n", &rate.numerator, &end, &rate.denominator, &end);
  if (fields < 1 || text[end] != 0 || rate.numerator < 1 || rate.denominator < 1 ||
      rate.numerator > 1000 * rate.denominator)
    throw lf::Error("--framerate " + text + ": must be frames per second, as 30 or 30000/1001");
  return rate;
}

double parse_seconds(const std::string& text) {
  int end = 0;
  double value = 0;
  if (std::sscanf(text.c_str(), "%lf%n", &value, &end) != 1 || text[end] != 0 || !(value > 0 && value <= 3600))
    throw lf::Error("--seconds " + text + ": must be more than 0, an hour at most");
  return value;
}

// What one camera records: the film, and where the lights are in it.
json record(const LightOptions& options, const std::string& folder, const lf::LightsPath& path,
            const lf::Camera& camera, size_t index, const std::function<void()>& step) {
  const FrameRate rate = parse_rate(options.framerates[index % options.framerates.size()]);
  const double seconds = parse_seconds(options.seconds[index % options.seconds.size()]);
  const auto frames = std::max<int64_t>(1, std::llround(seconds * rate.numerator / rate.denominator));
  const lf::LightsCamera lights(path, {camera.width, camera.height, camera.lens, camera.pose});
  MjpegWriter writer((fs::path(folder) / (camera.name + ".mkv")).string(), camera.width, camera.height, rate,
                     options.quality);
  json list = json::array();
  for (int64_t n = 0; n < frames; n++, step()) {
    const double stamp = static_cast<double>(n) * rate.denominator / rate.numerator;
    // A stamp is short of the true capture time by the camera's offset.
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
  const lf::Rig rig = lf::load_rig(options.rig);
  const lf::LightsPath path(rig, options.lights);
  check_file_names(rig);
  size_t frames = 0;
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    const FrameRate rate = parse_rate(options.framerates[i % options.framerates.size()]);
    const double seconds = parse_seconds(options.seconds[i % options.seconds.size()]);
    frames += std::max<int64_t>(1, std::llround(seconds * rate.numerator / rate.denominator));
  }
  lf::FolderUpdate update(options.out);
  Progress progress("filming", frames);
  std::mutex mutex;
  std::vector<json> cameras(rig.cameras.size());
  lf::WorkerPool().run(static_cast<unsigned>(options.threads), rig.cameras.size(), [&](size_t i) {
    cameras[i] = record(options, update.staging(), path, rig.cameras[i], i, [&] {
      const std::lock_guard lock(mutex);
      progress.step();
    });
  });
  progress.finish();
  update.commit();
  const json truth = {
      {"format", "lightfield-tracks"}, {"version", 1}, {"bar", path.num_lights() == 2}, {"cameras", cameras}};
  lf::write_text_file(truth.dump() + "\n", (fs::path(options.out) / "lights.json").string());
  lf::Rig filmed = rig;
  for (lf::Camera& camera : filmed.cameras) camera.source = camera.name + ".mkv", camera.image.clear();
  const std::string rig_path = (fs::path(options.out) / "rig.json").string();
  lf::save_rig(filmed, rig_path);
  std::printf("%zu cameras, %zu frames: %s\n", rig.cameras.size(), frames, rig_path.c_str());
}

}  // namespace

cli::App* add_lights_command(cli::App& app) {
  const auto o = std::make_shared<LightOptions>();
  cli::App* command = app.add_subcommand(
      "lights",
      "Films a light, or two on a bar, moved through the dark, as recordings for lf-calibrate track: DIR/NAME.mkv of "
      "each camera; the truth is DIR/rig.json, with the time offsets of RIG, and DIR/lights.json");
  command->add_option("--rig", o->rig, "film with the cameras of this rig")->required()->type_name("RIG.json");
  command->add_option("--out", o->out, "folder to write to")->required()->type_name("DIR");
  command->add_option("--bar", o->lights.bar, "metres between the two lights; 0: one light")
      ->capture_default_str()
      ->check(cli::NonNegativeNumber);
  command->add_option("--framerate", o->framerates, "frames per second; of several, cameras have one each in turn")
      ->delimiter(',')
      ->capture_default_str();
  command->add_option("--seconds", o->seconds, "length; of several, cameras have one each in turn")
      ->delimiter(',')
      ->capture_default_str();
  command->add_option("--speed", o->lights.speed, "of the lights, metres a second")
      ->capture_default_str()
      ->check(cli::PositiveNumber);
  command->add_option("--near", o->lights.near, "metres before the array")->capture_default_str();
  command->add_option("--far", o->lights.far, "metres before the array")->capture_default_str();
  command->add_option("--power", o->lights.power, "light of a pixel amid a light 1 m away: 1 saturates")
      ->capture_default_str()
      ->check(cli::PositiveNumber);
  command->add_option("--exposure", o->lights.exposure, "seconds")
      ->capture_default_str()
      ->check(cli::NonNegativeNumber);
  command->add_option("--noise", o->lights.noise, "of samples, of 255")
      ->capture_default_str()
      ->check(cli::NonNegativeNumber);
  command->add_option("--ambient", o->lights.ambient, "light that is left in the room, of the scene's own")
      ->capture_default_str()
      ->check(cli::NonNegativeNumber);
  command->add_option("--reflection", o->lights.reflection, "share of the lights that a window behind reflects")
      ->capture_default_str()
      ->check(cli::Range(0.0, 1.0));
  command->add_option("--quality", o->quality, "of JPEG")->capture_default_str()->check(cli::Range(1, 100));
  command->add_option("--threads", o->threads)->capture_default_str()->check(cli::Range(1, 256));
  command->callback([o] { film_lights(*o); });
  return command;
}
