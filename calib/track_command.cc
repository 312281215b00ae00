// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-calibrate track: where each camera's recording shows a moving light, or the two of a bar.
#include <gst/gst.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/json_value.h"
#include "base/worker_pool.h"
#include "calibration/light_detector.h"
#include "calibration/light_report.h"
#include "calibration/light_sights.h"
#include "commands.h"
#include "grey_video.h"
#include "progress.h"
#include "rig/rig_json.h"

namespace {

namespace fs = std::filesystem;

struct Options {
  std::string rig, recordings, out;
  bool bar = false;
  int threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
};

// DIR/NAME.* where there is a folder of recordings, else the camera's source.
std::string recording_of(const Options& options, const lf::Rig& rig, const lf::Camera& camera) {
  if (options.recordings.empty()) {
    if (camera.source.empty())
      throw lf::Error("the rig names no source of it: give --recordings, a folder with " + camera.name + ".*");
    if (lf::is_uri(camera.source) && !camera.source.starts_with("file:"))
      throw lf::Error(camera.source + " is live: record it first, and give --recordings");
    return rig.resolve(camera.source);
  }
  std::vector<std::string> found;
  for (const auto& entry : fs::directory_iterator(options.recordings))
    if (entry.is_regular_file() && entry.path().stem() == camera.name && entry.path().extension() != ".png" &&
        entry.path().extension() != ".json")
      found.push_back(entry.path().string());
  if (found.empty()) throw lf::Error(options.recordings + " has no recording " + camera.name + ".*");
  if (found.size() > 1) throw lf::Error(found[0] + " and " + found[1] + " are both of one camera");
  return found[0];
}

struct Watched {
  lf::LightSights::Camera sights;
  lf::LightRecord record;
  std::string trouble;  // why there is no recording
};

Watched watch(const Options& options, const lf::Rig& rig, const lf::Camera& camera,
              const std::function<void(double)>& progress) {
  Watched watched;
  watched.sights = {camera.id, camera.width, camera.height, {}};
  try {
    lf::LightDetector detector(camera.width, camera.height);
    for_each_picture(recording_of(options, rig, camera), [&](const GreyPicture& picture) {
      if (picture.width != camera.width || picture.height != camera.height)
        throw lf::Error("its pictures are " + std::to_string(picture.width) + "x" + std::to_string(picture.height) +
                        ", the rig has it as " + std::to_string(camera.width) + "x" + std::to_string(camera.height));
      // Stamps that stand still, or go back, are of a damaged recording.
      auto& frames = watched.sights.frames;
      if (frames.empty() || picture.time > frames.back().time)
        frames.push_back({picture.time, detector.look(picture.samples, picture.stride)});
      progress(picture.progress);
      return true;
    });
    watched.record = detector.record();
  } catch (const lf::Error& e) {
    watched.trouble = e.what();
  }
  return watched;
}

std::vector<Watched> watch_all(const Options& options, const lf::Rig& rig) {
  std::vector<Watched> all(rig.cameras.size());
  constexpr int kSteps = 100;
  Progress bar("looking for lights", kSteps * rig.cameras.size());
  std::mutex mutex;
  lf::WorkerPool().run(static_cast<unsigned>(options.threads), rig.cameras.size(), [&](size_t i) {
    int done = 0;
    const auto progress = [&](double share) {
      const std::lock_guard lock(mutex);
      for (; done < static_cast<int>(share * kSteps); done++) bar.step();
    };
    all[i] = watch(options, rig, rig.cameras[i], progress);
    progress(1);
  });
  return all;
}

void track(const Options& options) {
  gst_init(nullptr, nullptr);
  const lf::Rig rig = lf::load_rig(options.rig);
  if (!options.recordings.empty() && !fs::is_directory(options.recordings))
    throw lf::Error(options.recordings + ": is no folder");
  lf::LightSights sights;
  sights.bar = options.bar;
  std::printf("%-8s %-16s %8s %7s %7s %9s %9s\n", "camera", "name", "pictures", "seconds", "lit %", "coverage",
              "sigma px");
  std::vector<std::string> remarks, troubles;
  const std::vector<Watched> all = watch_all(options, rig);
  for (size_t i = 0; i < all.size(); i++) {
    const lf::LightSummary summary = lf::summarize_lights(all[i].sights, all[i].record);
    const std::string who = "camera " + std::to_string(rig.cameras[i].id) + " (" + rig.cameras[i].name + ")";
    std::printf("%-8u %-16s %8zu %7.1f %7.1f %7.0f %% %9.3f\n", rig.cameras[i].id, rig.cameras[i].name.c_str(),
                all[i].record.frames, summary.seconds, 100 * summary.lit, 100 * summary.coverage, summary.sigma);
    if (!all[i].trouble.empty())
      troubles.push_back(who + ": " + all[i].trouble);
    else if (summary.trouble)
      troubles.push_back(who + " " + *summary.trouble);
    for (const std::string& remark : summary.remarks) remarks.push_back(who + ": " + remark);
    sights.cameras.push_back(all[i].sights);
  }
  for (const lf::Finding& finding : lf::compare_recordings(sights)) remarks.push_back(finding.text);
  for (const std::string& remark : remarks) std::printf("note: %s\n", remark.c_str());
  for (const std::string& trouble : troubles) std::printf("error: %s\n", trouble.c_str());
  if (troubles.size() + 2 > rig.cameras.size())
    throw lf::Error("fewer than two cameras saw a moving light: nothing is written");
  lf::write_text_file(lf::light_sights_to_json(sights), options.out);
  std::printf("%s: %zu of %zu cameras\n", options.out.c_str(), rig.cameras.size() - troubles.size(),
              rig.cameras.size());
  if (!troubles.empty())
    throw lf::Error(std::to_string(troubles.size()) + " of " + std::to_string(rig.cameras.size()) +
                    " cameras did not see the light move; " + options.out + " has the others");
}

}  // namespace

void add_track_command(cli::App& app) {
  const auto o = std::make_shared<Options>();
  cli::App* command =
      app.add_subcommand("track", "Sights of a light moved through the dark, or of two on a bar, in recordings");
  command->add_option("RIG", o->rig, "Rig file; a nominal one will do")->required();
  command->add_option("--recordings", o->recordings, "Folder with NAME.* of each camera; else its source in the rig")
      ->type_name("DIR");
  command->add_flag("--bar", o->bar, "Two lights on a rigid bar were moved");
  command->add_option("--out", o->out, "Tracks to write (JSON), for solve")->required();
  command->add_option("--threads", o->threads, "Recordings that are looked at together")
      ->capture_default_str()
      ->check(cli::Range(1, 256));
  command->callback([o] { track(*o); });
}
