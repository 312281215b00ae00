// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-calibrate: measures the cameras of an array, step by step. Its short commands are here.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <sys/stat.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "calibration/feature_tracks.h"
#include "calibration/tracks.h"
#include "command_line.h"
#include "commands.h"
#include "report_data.h"
#include "report_page.h"
#include "rig/rig_json.h"
#include "rig/still_images.h"
#include "solver_log.h"

namespace {

struct ReportArguments {
  std::vector<std::string> files;
  std::string out = "report.html", title;
};

void write_report(const ReportArguments& o) {
  ReportData data;
  for (const std::string& file : o.files) data.add(lf::parse_json(lf::read_text_file(file), file), file);
  const ReportVerdict verdict = judge(data);
  const std::string title =
      o.title.empty() ? std::filesystem::absolute(o.files[0]).parent_path().filename().string() : o.title;
  lf::write_text_file(report_page(data, verdict, title), o.out);
  std::printf("%s: %s\n", o.out.c_str(), verdict.headline.c_str());
  for (const std::string& step : verdict.next) std::printf("- %s\n", step.c_str());
}

void add_report_command(cli::App& app) {
  const auto o = std::make_shared<ReportArguments>();
  cli::App* command = app.add_subcommand(
      "report", "One page of what the steps said: a verdict for each camera, plots, and what to do next");
  command->add_option("FILE", o->files, "What --json of track, solve, colour and check wrote, any of them")->required();
  command->add_option("--out", o->out, "Page to write (HTML); opens from disk, without a network")
      ->capture_default_str();
  command->add_option("--title", o->title, "Of the page (default: the files' folder)");
  command->callback([o] { write_report(*o); });
}

struct FeaturesOptions {
  std::string rig, out;
  int every = 1;
  lf::FeatureOptions features;
};

void find_features(FeaturesOptions options) {
  lf::Rig rig = lf::load_rig(options.rig);
  if (options.every > 1) rig = lf::every_nth(rig, options.every);
  lf::StillImages stills(rig);
  std::vector<lf::Image> images;
  for (lf::CameraIndex i = 0; i < rig.cameras.size(); i++) images.push_back(stills.get(i));
  options.features.progress = [](const std::string& step) { std::fprintf(stderr, "%s\n", step.c_str()); };
  const lf::Tracks tracks = lf::track_features(rig, images, options.features);
  lf::write_text_file(lf::tracks_to_json(tracks), options.out);
  std::printf("%s: %zu tracks, %zu observations, %.1f cameras a track\n", options.out.c_str(), tracks.num_positions,
              tracks.observations.size(),
              static_cast<double>(tracks.observations.size()) / static_cast<double>(tracks.num_positions));
}

void add_features_command(cli::App& app) {
  const auto o = std::make_shared<FeaturesOptions>();
  cli::App* command =
      app.add_subcommand("features", "Tracks of a still scene's corners, from a rig with an image each");
  command->add_option("RIG", o->rig, "Rig file; a nominal one will do")->required();
  command->add_option("--every", o->every, "Rows and columns 0, N, 2N, ... of a grid")->check(cli::PositiveNumber);
  command->add_option("--references", o->features.references, "Cameras whose corners are followed")
      ->capture_default_str()
      ->check(cli::Range(1, static_cast<int>(lf::kMaxCameras)));
  command->add_option("--features", o->features.features, "Corners a reference camera")
      ->capture_default_str()
      ->check(cli::Range(1, 1000000));
  command->add_option("--least-cameras", o->features.least_cameras, "That must see a track")
      ->capture_default_str()
      ->check(cli::Range(2, static_cast<int>(lf::kMaxCameras)));
  command->add_option("--out", o->out, "Tracks to write (JSON)")->required();
  command->callback([o] { find_features(*o); });
}

}  // namespace

int main(int argc, char** argv) {
  cli::App app("Measures the cameras of an array: lenses, positions, orientations, each with its uncertainty",
               "lf-calibrate");
  app.require_subcommand(1);
  lf::catch_solver_messages();
  int status = 0;
  add_all_command(app, status);
  add_check_command(app, status);
  add_colour_command(app);
  add_features_command(app);
  add_intrinsics_command(app);
  add_report_command(app);
  add_solve_command(app);
  add_track_command(app);
  // A log says why nothing came of it, as the terminal does.
  const int failed = cli::run_tool(
      app, argc, argv, [] {},
      [](const std::string& error) {
        struct stat out = {};
        if (fstat(STDOUT_FILENO, &out) == 0 && S_ISREG(out.st_mode)) std::printf("error: %s\n", error.c_str());
      });
  // What the solver has said may explain a failure; else it is of no use to a person.
  for (const std::string& message : failed ? lf::solver_messages() : std::vector<std::string>())
    std::fprintf(stderr, "note: the solver says: %s\n", message.c_str());
  // The statuses 0 and 1 of check are its answers; a command line or file that is wrong gives no answer.
  if (failed && *app.get_subcommand("check")) return 2;
  return failed ? failed : status;
}
