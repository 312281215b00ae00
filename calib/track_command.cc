// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-calibrate track: where each camera's recording shows a moving light, or the two of a bar.
#include <gst/gst.h>

#include <cstdio>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_value.h"
#include "commands.h"
#include "light_recordings.h"
#include "rig/rig_json.h"

namespace {

using nlohmann::ordered_json;

struct TrackArguments {
  std::string rig, recordings, out, json;
  bool bar = false;
  int threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
};

// {"format": "lightfield-track-report", "findings", "cameras": [{"id", "name", "pictures", "seconds", "lit",
// "coverage", "sigma_px", "trouble", "remarks"}]}: what is wrong with a recording, and what would make it better.
ordered_json report(const lf::Rig& rig, const LightRecordings& recordings) {
  ordered_json cameras = ordered_json::array(), findings = ordered_json::array();
  const std::vector<std::string> troubles = recordings.troubles(rig);
  auto trouble = troubles.begin();
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    const LightRecordings::Camera& camera = recordings.cameras[i];
    cameras.push_back({{"id", rig.cameras[i].id},
                       {"name", rig.cameras[i].name},
                       {"pictures", camera.record.frames},
                       {"seconds", camera.summary.seconds},
                       {"lit", camera.summary.lit},
                       {"coverage", camera.summary.coverage},
                       {"sigma_px", camera.summary.sigma},
                       {"trouble", camera.trouble.empty() ? "" : *trouble++},
                       {"remarks", camera.summary.remarks}});
  }
  for (const lf::Finding& finding : recordings.findings)
    findings.push_back({{"severity", "note"}, {"code", finding.code}, {"text", finding.text}});
  return {{"format", "lightfield-track-report"}, {"version", 1}, {"findings", findings}, {"cameras", cameras}};
}

void track(const TrackArguments& options) {
  gst_init(nullptr, nullptr);
  const lf::Rig rig = lf::load_rig(options.rig);
  const LightRecordings recordings = watch_lights(rig, options.recordings, options.bar, options.threads);
  std::printf("%-8s %-16s %8s %7s %7s %9s %9s\n", "camera", "name", "pictures", "seconds", "lit %", "coverage",
              "sigma px");
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    const auto& [record, summary, trouble] = recordings.cameras[i];
    std::printf("%-8u %-16s %8zu %7.1f %7.1f %7.0f %% %9.3f\n", rig.cameras[i].id, rig.cameras[i].name.c_str(),
                record.frames, summary.seconds, 100 * summary.lit, 100 * summary.coverage, summary.sigma);
  }
  for (size_t i = 0; i < rig.cameras.size(); i++)
    for (const std::string& remark : recordings.cameras[i].summary.remarks)
      std::printf("note: camera %u (%s): %s\n", rig.cameras[i].id, rig.cameras[i].name.c_str(), remark.c_str());
  for (const lf::Finding& finding : recordings.findings) std::printf("note: %s\n", finding.text.c_str());
  for (const std::string& trouble : recordings.troubles(rig)) std::printf("error: %s\n", trouble.c_str());
  if (!options.json.empty()) lf::write_text_file(report(rig, recordings).dump(1) + "\n", options.json);
  const size_t useful = recordings.useful(), all = rig.cameras.size();
  if (useful < 2) throw lf::Error("fewer than two cameras saw a moving light: nothing is written");
  lf::write_text_file(lf::light_sights_to_json(recordings.sights), options.out);
  std::printf("%s: %zu of %zu cameras\n", options.out.c_str(), useful, all);
  if (useful < all)
    throw lf::Error(std::to_string(all - useful) + " of " + std::to_string(all) +
                    " cameras did not see the light move; " + options.out + " has the others");
}

}  // namespace

void add_track_command(cli::App& app) {
  const auto o = std::make_shared<TrackArguments>();
  cli::App* command =
      app.add_subcommand("track", "Sights of a light moved through the dark, or of two on a bar, in recordings");
  command->add_option("RIG", o->rig, "Rig file; a nominal one will do")->required();
  command->add_option("--recordings", o->recordings, "Folder with NAME.* of each camera; else its source in the rig")
      ->type_name("DIR");
  command->add_flag("--bar", o->bar, "Two lights on a rigid bar were moved");
  command->add_option("--out", o->out, "Tracks to write (JSON), for solve")->required();
  command->add_option("--json", o->json, "Report to write")->type_name("FILE");
  command->add_option("--threads", o->threads, "Recordings that are looked at together")
      ->capture_default_str()
      ->check(cli::Range(1, 256));
  command->callback([o] { track(*o); });
}
