// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-calibrate track: detects a moving light, or two lights on a bar, in the recordings of each camera.
// lf-calibrate solve: estimates positions, orientations and lenses from these tracks.
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gst/gst.h>
#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "calibration/moving_light.h"
#include "calibration/tracks.h"
#include "commands.h"
#include "recordings.h"
#include "rig/rig_json.h"
#include "solution_output.h"
#include "terminal.h"

namespace {

using nlohmann::ordered_json;

struct TrackArguments {
  std::string rig, recordings, out, json;
  bool bar = false;
  int threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
};

// Returns the report with problems of the recordings and possible improvements:
//    {"format": "lightfield-track-report", "findings",
//     "cameras": [{"id", "name", "pictures", "seconds", "lit", "coverage", "sigma_px", "trouble", "remarks"}]}
ordered_json track_report(const lf::Rig& rig, const LightRecordings& recordings) {
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
  const LightRecordings recordings = detect_lights(rig, options.recordings, options.bar, options.threads);
  terminal::print("%-8s %-16s %8s %7s %7s %9s %9s\n", "camera", "name", "pictures", "seconds", "lit %", "coverage",
                  "sigma px");
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    const auto& [record, summary, trouble] = recordings.cameras[i];
    terminal::print("%-8u %-16s %8zu %7.1f %7.1f %7.0f %% %9.3f\n", rig.cameras[i].id, rig.cameras[i].name.c_str(),
                    record.frames, summary.seconds, 100 * summary.lit, 100 * summary.coverage, summary.sigma);
  }
  for (size_t i = 0; i < rig.cameras.size(); i++)
    for (const std::string& remark : recordings.cameras[i].summary.remarks)
      terminal::print("note: camera %u (%s): %s\n", rig.cameras[i].id, rig.cameras[i].name.c_str(), remark.c_str());
  for (const lf::Finding& finding : recordings.findings) terminal::print("note: %s\n", finding.text.c_str());
  for (const std::string& trouble : recordings.troubles(rig)) terminal::print("error: %s\n", trouble.c_str());
  if (!options.json.empty()) lf::write_text_file(track_report(rig, recordings).dump(1) + "\n", options.json);
  const size_t useful = recordings.useful(), all = rig.cameras.size();
  if (useful < 2)
    throw lf::Error("fewer than two cameras saw a moving light, so no tracks are written; see the reasons above");
  lf::write_text_file(lf::light_detections_to_json(recordings.sights), options.out);
  terminal::print("%s: %zu of %zu cameras\n", options.out.c_str(), useful, all);
  if (useful < all)
    throw lf::Error(std::to_string(all - useful) + " of " + std::to_string(all) +
                    " cameras did not see the light move and are not in " + options.out);
}

}  // namespace

void add_track_command(cli::App& app) {
  const auto o = std::make_shared<TrackArguments>();
  cli::App* command =
      app.add_subcommand("track",
                         "Detects a light that moves through the dark, or two lights on a bar, in recordings of all "
                         "cameras. Writes tracks: the positions of each light in the images");
  command->add_option("RIG", o->rig, "Rig file of the array. Its camera positions may be nominal")->required();
  command
      ->add_option("--recordings", o->recordings,
                   "Folder with a recording NAME.* of each camera (default: the sources of the rig)")
      ->type_name("DIR");
  command->add_flag("--bar", o->bar,
                    "The recordings show two lights on a rigid bar, instead of a single light. The known distance "
                    "between the lights then gives the scale of the rig");
  command->add_option("--out", o->out, "JSON file that receives the tracks, for lf-calibrate solve")->required();
  command->add_option("--json", o->json, "JSON file that receives the report, for lf-calibrate report")
      ->type_name("FILE");
  command
      ->add_option("--threads", o->threads,
                   "Number of recordings to process at the same time. More recordings use "
                   "more processors and memory")
      ->check(cli::Range(1, 256));
  command->callback([o] { track(*o); });
}

namespace {

using nlohmann::json;

struct SolveArguments {
  std::string tracks, prior, out, json, distortion = "auto", distance;
  double first_pixel = 0;
  const cli::Option* first_pixel_option = nullptr;
  lf::PlacementOptions placement;
};

std::optional<lf::DistortionModel> distortion_of(const std::string& name) {
  if (name == "auto") return std::nullopt;
  return lf::DistortionModel{name == "none" ? 0 : name == "k1" ? 1 : 2, false};
}

lf::PlacementOptions::Distance parse_distance(const std::string& text) {
  lf::PlacementOptions::Distance d;
  int end = 0;
  if (std::sscanf(text.c_str(), "%u,%u,%n", &d.a, &d.b, &end) != 2 || end == 0) end = static_cast<int>(text.size());
  const auto [rest, error] = std::from_chars(text.data() + end, text.data() + text.size(), d.metres);
  if (error != std::errc() || rest != text.data() + text.size() || !(d.metres > 0 && lf::is_finite(d.metres)))
    throw lf::Error("--distance " + text + ": must be two camera ids and a distance in metres, such as 0,7,0.84");
  return d;
}

void solve(const SolveArguments& o) {
  lf::SolveOptions options;
  options.distortion = distortion_of(o.distortion);
  SolveProgress progress("solving", options.progress);
  lf::PlacementOptions placement_options = o.placement;
  if (!o.distance.empty()) placement_options.distance = parse_distance(o.distance);
  lf::Tracks tracks;
  std::optional<lf::LightDetections> sights;
  json original = json::object();
  if (std::filesystem::is_directory(o.tracks)) {
    lf::MultiCamSelfCal input = lf::load_multicamselfcal(o.tracks, o.first_pixel);
    tracks = std::move(input.tracks);
    options.prior = std::move(input.lenses);
  } else {
    if (*o.first_pixel_option) throw lf::Error("--first-pixel: applies only to a folder of MultiCamSelfCal files");
    const std::string text = lf::read_text_file(o.tracks);
    sights = lf::parse_light_detections(text, o.tracks);
    if (!sights) tracks = lf::parse_tracks(text, o.tracks);
  }
  if (!o.prior.empty()) original = load_prior(o.prior, options);
  std::optional<lf::LightSolution> lights;
  if (sights) {
    lights = lf::solve_lights(*sights, {options});
    tracks = lights->tracks;
  }
  const lf::Solution solution = lights ? std::move(lights->solution) : lf::solve_tracks(tracks, options);
  save_solution({solution, tracks, options, placement_options, lights ? &*lights : nullptr, nullptr, {}},
                std::move(original), "lf-calibrate solve", o.out, o.json, progress);
}

}  // namespace

void add_solve_command(cli::App& app) {
  const auto o = std::make_shared<SolveArguments>();
  cli::App* command = app.add_subcommand(
      "solve", "Estimates the positions, orientations and lenses of all cameras from tracks of a moving light");
  command
      ->add_option("--tracks", o->tracks,
                   "JSON file with tracks, written by track or features. A folder with the input files of "
                   "MultiCamSelfCal works, too")
      ->required()
      ->check(cli::ExistingPath)
      ->type_name("FILE|DIR");
  command
      ->add_option("--prior", o->prior,
                   "Rig file with prior knowledge: the lenses, optionally with covariances, and the nominal positions "
                   "of the cameras")
      ->type_name("RIG");
  command
      ->add_option("--distortion", o->distortion,
                   "Number of radial distortion terms to estimate for each camera. More terms describe wide-angle "
                   "lenses better, but need more observations. auto: as many as the tracks support")
      ->check(cli::IsMember({"auto", "none", "k1", "k1k2"}));
  cli::Option* bar =
      command
          ->add_option("--bar", o->placement.bar_length,
                       "Distance between the two lights on the bar, in metres. It determines the scale of the rig")
          ->check(cli::PositiveNumber);
  cli::Option* pitch =
      command
          ->add_option("--pitch", o->placement.pitch,
                       "Median distance between neighbouring cameras, in metres. It determines the scale of the rig. "
                       "Use it if there is no bar with two lights")
          ->check(cli::PositiveNumber)
          ->excludes(bar);
  command
      ->add_option("--distance", o->distance,
                   "Ids of two cameras and the distance between them, in metres, for example 0,7,0.84. It determines "
                   "the scale of the rig")
      ->type_name("ID,ID,METRES")
      ->excludes(bar)
      ->excludes(pitch);
  o->first_pixel_option = command
                              ->add_option("--first-pixel", o->first_pixel,
                                           "Coordinate of the centre of the top-left pixel in the MultiCamSelfCal "
                                           "files. Files written by Matlab need 1")
                              ->capture_default_str()
                              ->check(cli::IsMember({0, 1}));
  command->add_option("--out", o->out, "Rig file to write, with the estimated cameras")->required()->type_name("RIG");
  command->add_option("--json", o->json, "JSON file that receives the report, for lf-calibrate report")
      ->type_name("FILE");
  command->callback([o] { solve(*o); });
}
