// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-rig snapshot: a still of each camera at one instant.
#include <gst/gst.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <set>
#include <string>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/file.h"
#include "base/json_value.h"
#include "cameras/commands.h"
#include "cameras/doctor.h"
#include "cameras/rig_cameras.h"
#include "cameras/snapshot.h"
#include "rig/rig_json.h"
#include "timed_progress.h"

namespace {

namespace fs = std::filesystem;

struct SnapshotArguments {
  std::string rig, out, cameras;
  lf::cameras::SnapshotOptions snapshot;
};

// By the cameras' names where these are different and fit for files, else by their ids.
std::string file_name(const lf::Rig& rig, const lf::Camera& camera) {
  const auto fits = [](const std::string& name) {
    return !name.empty() && name[0] != '.' && name.find_first_of("/\\%") == std::string::npos;
  };
  std::set<std::string> names;
  bool all = true;
  for (const lf::Camera& one : rig.cameras) all = all && fits(one.name) && names.insert(one.name).second;
  return (all ? camera.name : "camera_" + std::to_string(camera.id)) + ".png";
}

int take_snapshot(SnapshotArguments options) {
  gst_init(nullptr, nullptr);
  const auto rig = std::make_shared<const lf::Rig>(lf::load_rig(options.rig));
  options.snapshot.cameras = lf::parse_camera_list(*rig, options.cameras);
  std::vector<lf::cameras::Still> stills;
  {
    // Beside the seconds that they run, one to open them.
    const TimedProgress progress("opening " + std::to_string(options.snapshot.cameras.size()) + " cameras",
                                 options.snapshot.warm_up + 1);
    stills = lf::cameras::take_snapshot(rig, options.rig, options.snapshot);
  }
  lf::FolderUpdate update(options.out);
  lf::Rig result = *rig;
  const nlohmann::json original = lf::parse_json(lf::read_text_file(options.rig), options.rig);
  lf::relocate(result, options.out);
  int missing = 0;
  for (const lf::cameras::Still& still : stills) {
    lf::Camera& camera = result.cameras[still.camera];
    if (still.rgb.data().empty()) {
      missing++;
      std::printf("camera %s: %s: %s\n", lf::cameras::name_of(camera).c_str(), still.problem.c_str(),
                  lf::cameras::remedy_of(camera, still.problem).c_str());
      continue;
    }
    camera.image = file_name(*rig, camera);
    lf::save_image(still.rgb, (fs::path(update.staging()) / camera.image).string());
    std::printf("camera %s: %s, %+.1f ms\n", lf::cameras::name_of(camera).c_str(), camera.image.c_str(),
                1e3 * still.off);
  }
  if (static_cast<size_t>(missing) == stills.size())
    throw lf::Error("no camera gave a still: " + options.out + " stays as it was");
  update.commit();
  lf::save_rig(result, (fs::path(options.out) / "rig.json").string(), &original);
  std::printf("%s/rig.json: %zu stills of one instant, %d cameras without\n", options.out.c_str(),
              stills.size() - static_cast<size_t>(missing), missing);
  return missing > 0 ? 1 : 0;
}

}  // namespace

void add_snapshot_command(cli::App& app, int& status) {
  const auto o = std::make_shared<SnapshotArguments>();
  cli::App* command = app.add_subcommand(
      "snapshot", "A still of each camera at one instant, and a rig file of them; exit status 1 if one is missing");
  command->add_option("RIG", o->rig, "Rig file")->required();
  command->add_option("--out", o->out, "Folder to write: a PNG file a camera, and rig.json")->required();
  command->add_option("--cameras", o->cameras, "Ids: 0-3,7 (default: all)");
  command->add_option("--after", o->snapshot.warm_up, "Seconds that the cameras run before")
      ->capture_default_str()
      ->check(cli::Range(0.0, 600.0));
  cli::add_trust_option(*command, o->snapshot.trusted);
  command->callback([o, &status] { status = take_snapshot(*o); });
}
