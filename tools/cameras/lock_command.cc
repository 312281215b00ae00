// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-rig lock: what one camera has chosen by itself becomes the setting of all.
#include <gst/gst.h>

#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_value.h"
#include "cameras/commands.h"
#include "cameras/doctor.h"
#include "cameras/lock.h"
#include "cameras/rig_cameras.h"
#include "rig/camera_controls.h"
#include "rig/rig_json.h"
#include "timed_progress.h"

namespace {

struct LockArguments {
  std::string rig, out;
  uint32_t camera = 0;
  int mains = 0;
  bool no_check = false;
  lf::cameras::LockOptions lock;
};

int lock_cameras(LockArguments options) {
  gst_init(nullptr, nullptr);
  lf::Rig rig = lf::load_rig(options.rig);
  nlohmann::json original = lf::parse_json(lf::read_text_file(options.rig), options.rig);
  const auto reference = rig.index_of_id(options.camera);
  if (!reference) throw lf::Error(options.rig + ": has no camera " + std::to_string(options.camera));
  options.lock.reference = *reference;
  options.lock.path = options.rig;
  if (options.mains > 0) options.lock.mains = options.mains;
  // Cameras take a second to open, about.
  const double look = options.lock.settle + 1;
  std::optional<TimedProgress> progress;
  progress.emplace("camera " + lf::cameras::name_of(rig.cameras[*reference]) + " looks around", look);
  lf::cameras::ControlValues values;
  try {
    values = lf::cameras::choose_controls(rig, options.lock);
  } catch (const lf::cameras::CameraFailure& failure) {
    throw lf::Error(std::string(failure.what()) + ": " +
                    lf::cameras::remedy_of(rig.cameras[*reference], failure.what()));
  }
  progress.reset();
  std::map<uint32_t, lf::Controls> controls = lf::parse_controls(original, options.rig);
  for (const lf::Camera& camera : rig.cameras) {
    for (const auto& [name, value] : values) controls[camera.id][name] = value;
    if (options.mains > 0) controls[camera.id]["mains_frequency"] = options.mains;
  }
  lf::put_controls(controls, original);
  for (const auto& [name, value] : values) std::printf("%s: %.6g\n", name.c_str(), value);
  std::vector<lf::cameras::StuckControl> stuck;
  if (!options.no_check)
    stuck = lf::cameras::find_stuck_controls(rig, values, options.lock, [&](const std::string& step) {
      progress.reset();
      progress.emplace(step, look);
    });
  progress.reset();
  for (const lf::cameras::StuckControl& one : stuck)
    std::printf("warning: camera %s: %s%s\n", lf::cameras::name_of(rig.cameras[one.camera]).c_str(),
                one.control.empty() ? "" : (one.control + " does not respond: ").c_str(), one.why.c_str());
  const std::string out = options.out.empty() ? options.rig : options.out;
  lf::relocate(rig, std::filesystem::path(out).parent_path().string());
  lf::save_rig(rig, out, &original);
  std::printf("%s: %zu cameras are set alike\n", out.c_str(), rig.cameras.size());
  return stuck.empty() ? 0 : 1;
}

}  // namespace

void add_lock_command(cli::App& app, int& status) {
  const auto o = std::make_shared<LockArguments>();
  cli::App* command = app.add_subcommand(
      "lock",
      "Sets all cameras to the exposure, gain, white balance and focus that one of them has chosen by "
      "itself, and finds controls that do not respond; exit status 1 if there are some");
  command->add_option("RIG", o->rig, "Rig file")->required();
  command->add_option("--camera", o->camera, "Id of the camera that chooses")->capture_default_str();
  command->add_option("--mains", o->mains, "Frequency of the lamps' mains, hertz: exposures that do not flicker")
      ->check(cli::IsMember({50, 60}));
  command->add_option("--settle", o->lock.settle, "Seconds that cameras get to adjust")
      ->capture_default_str()
      ->check(cli::Range(0.1, 120.0));
  command->add_flag("--no-check", o->no_check, "Believe that all cameras respond");
  command->add_option("--out", o->out, "Rig file to write (default: the same)");
  cli::add_trust_option(*command, o->lock.trusted);
  command->callback([o, &status] { status = lock_cameras(*o); });
}
