// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-calibrate check: whether a calibrated rig still holds, by a later recording or by what the running monitor says.
#include <gst/gst.h>

#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_value.h"
#include "calibration/moving_light.h"
#include "calibration/rig_check.h"
#include "commands.h"
#include "light_recordings.h"
#include "monitor_check.h"
#include "rig/location_text.h"
#include "rig/rig_json.h"
#include "solve_progress.h"

namespace {

using nlohmann::json;

struct CheckArguments {
  std::string rig, recordings, tracks, monitor, token_file, json;
  double bar = 0;
  int threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
};

// What is known of the lenses: positions are what is to be found out.
lf::SolveOptions with_lenses(const lf::Rig& rig, const std::string& path) {
  lf::SolveOptions options;
  options.prior = rig;
  const json text = lf::parse_json(lf::read_text_file(path), path);
  for (const lf::JsonValue& camera : lf::JsonValue(text, path).at("cameras").elements()) {
    auto known = lf::parse_camera_covariance(camera);
    if (known) {
      lf::CameraCovariance lens;
      for (const std::string& name : known->parameters)
        if (std::string("x y z rx ry rz").find(name) == std::string::npos) lens.parameters.push_back(name);
      for (const std::string& row : lens.parameters)
        for (const std::string& column : lens.parameters)
          lens.matrix.push_back(known->at(*known->index_of(row), *known->index_of(column)));
      *known = std::move(lens);
      if (known->parameters.empty()) known.reset();
    }
    options.prior_covariances.push_back(std::move(known));
  }
  return options;
}

// At common instants: the cameras' clocks are found out anew, for a later recording may begin at any time.
lf::Tracks tracks_of(const CheckArguments& o, const lf::Rig& rig) {
  std::optional<lf::LightSights> sights;
  if (o.tracks.empty()) {
    gst_init(nullptr, nullptr);
    const LightRecordings recordings = watch_lights(rig, o.recordings, o.bar > 0, o.threads);
    for (const std::string& trouble : recordings.troubles(rig)) std::printf("warning: %s\n", trouble.c_str());
    if (recordings.useful() < 3)
      throw lf::Error("fewer than three cameras saw a moving light: nothing tells whether the rig holds");
    sights = recordings.sights;
  } else {
    const std::string text = lf::read_text_file(o.tracks);
    sights = lf::parse_light_sights(text, o.tracks);
    if (!sights) return lf::parse_tracks(text, o.tracks);
  }
  lf::SolveOptions options = with_lenses(rig, o.rig);
  SolveProgress progress("comparing", options);
  return lf::solve_lights(*sights, {options}).tracks;
}

json check_tracks(const CheckArguments& o, const lf::Rig& rig) {
  const lf::RigCheck check = lf::check_calibration(rig, tracks_of(o, rig));
  const std::vector<lf::Finding> findings = lf::diagnose_check(rig, check, o.bar);
  std::printf("%-8s %-16s %8s %12s %10s\n", "camera", "name", "sights", "residual px", "moved px");
  for (const lf::RigCheck::Camera& camera : check.cameras)
    std::printf("%-8u %-16s %8zu %12.3f %10.3f\n", camera.id, rig.cameras[*rig.index_of_id(camera.id)].name.c_str(),
                camera.sights, camera.residual_px, camera.shift_px);
  if (check.bar) std::printf("bar         %.1f mm by this rig, +-%.1f\n", 1e3 * *check.bar, 1e3 * *check.bar_spread);
  return json::parse(lf::check_report(rig, check, findings).dump());
}

int check(const CheckArguments& o) {
  const lf::Rig rig = lf::load_rig(o.rig);
  const json report = o.monitor.empty() ? check_tracks(o, rig) : check_monitor(rig, o.monitor, o.token_file);
  for (const json& finding : report["findings"])
    std::printf("%s: %s\n", finding["severity"].get<std::string>().c_str(), finding["text"].get<std::string>().c_str());
  size_t off = 0, unknown = 0;
  for (const json& camera : report["cameras"]) {
    unknown += camera["state"] == "unknown";
    off += camera["state"] != "unknown" && camera["state"] != "holds";
  }
  const bool holds = report["holds"];
  const size_t all = report["cameras"].size();
  if (holds)
    std::printf("%s holds: %zu of %zu cameras are where it says\n", o.rig.c_str(), all - unknown, all);
  else
    std::printf("%s does not hold: %zu of %zu cameras are off\n", o.rig.c_str(), off, all);
  if (!o.json.empty()) lf::write_text_file(report.dump(1) + "\n", o.json);
  return holds ? 0 : 1;
}

}  // namespace

void add_check_command(cli::App& app, int& status) {
  const auto o = std::make_shared<CheckArguments>();
  cli::App* command = app.add_subcommand(
      "check",
      "Whether a rig still holds, by a later recording of a moving light or by the monitor of lf-serve: which camera "
      "moved, and by how much. Exit status 0: it holds, 1: it does not, 2: nothing can be told");
  command->add_option("RIG", o->rig, "Rig file, calibrated")->required();
  cli::App* what = command->add_option_group("what tells");
  what->add_option("--recordings", o->recordings, "Folder with NAME.* of each camera")->type_name("DIR");
  what->add_option("--tracks", o->tracks, "Tracks (JSON) of track")->type_name("FILE");
  cli::Option* monitor =
      what->add_option("--monitor", o->monitor,
                       "Address of an lf-serve --monitor 30 that shows this rig, or what its monitor.json said")
          ->type_name("URL|FILE");
  what->require_option(1);
  command->add_option("--token-file", o->token_file, "Bearer token of that lf-serve")
      ->type_name("FILE")
      ->needs(monitor);
  command->add_option("--bar", o->bar, "Two lights were moved, so many metres apart: tells whether the scale holds")
      ->check(cli::PositiveNumber)
      ->excludes(monitor);
  command->add_option("--json", o->json, "Report to write")->type_name("FILE");
  command->callback([o, &status] {
    try {
      status = check(*o);
    } catch (const std::exception& error) {
      std::fprintf(stderr, "lf-calibrate: %s\n", lf::location_text(error.what()).c_str());
      status = 2;
    }
  });
}
