// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-calibrate: calibrates the cameras of an array. Contains main() and the short commands.
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
#include "rig/still_image_cache.h"
#include "solver_log.h"
#include "terminal.h"

namespace {

struct ReportArguments {
  std::vector<std::string> files;
  std::string out = "report.html", title;
};

void write_report(const ReportArguments& o) {
  ReportData data;
  for (const std::string& file : o.files) data.add(lf::parse_json(lf::read_text_file(file), file), file);
  const ReportVerdict verdict = grade_calibration(data);
  const std::string title =
      o.title.empty() ? std::filesystem::absolute(o.files[0]).parent_path().filename().string() : o.title;
  lf::write_text_file(report_page(data, verdict, title), o.out);
  terminal::print("%s: %s\n", o.out.c_str(), verdict.headline.c_str());
  for (const std::string& step : verdict.next) terminal::print("- %s\n", step.c_str());
}

void add_report_command(cli::App& app) {
  const auto o = std::make_shared<ReportArguments>();
  cli::App* command = app.add_subcommand(
      "report",
      "Writes a report as an HTML page, with a verdict for each camera, plots and recommendations for the next steps");
  command
      ->add_option("FILE", o->files,
                   "Reports of the calibration steps: the files that track, solve, colour and check write with --json")
      ->required();
  command->add_option("--out", o->out,
                      "HTML page to write. It contains all styles and figures, so you can share this single file");
  command->add_option("--title", o->title, "Title of the page (default: the name of the folder of the first FILE)");
  command->callback([o] { write_report(*o); });
}

struct FeaturesOptions {
  std::string rig, out;
  int every = 1;
  lf::FeatureOptions features;
};

void find_features(FeaturesOptions options) {
  lf::Rig rig = lf::load_rig(options.rig);
  if (options.every > 1) rig = lf::subsample_grid(rig, options.every);
  lf::StillImageCache stills(rig);
  std::vector<lf::Image> images;
  for (lf::CameraIndex i = 0; i < rig.cameras.size(); i++) images.push_back(stills.get(i));
  options.features.progress = [](const std::string& step) { terminal::print_error("%s\n", step.c_str()); };
  const lf::Tracks tracks = lf::track_features(rig, images, options.features);
  lf::write_text_file(lf::tracks_to_json(tracks), options.out);
  terminal::print("%s: %zu tracks, %zu observations, %.1f cameras per track\n", options.out.c_str(),
                  tracks.num_positions, tracks.observations.size(),
                  static_cast<double>(tracks.observations.size()) / static_cast<double>(tracks.num_positions));
}

void add_features_command(cli::App& app) {
  const auto o = std::make_shared<FeaturesOptions>();
  cli::App* command = app.add_subcommand("features",
                                         "Tracks corners of a static scene through one image per camera. Use this "
                                         "instead of track if the room cannot be darkened");
  command->add_option("RIG", o->rig, "Rig file with one still image per camera. Its camera positions may be nominal")
      ->required();
  command
      ->add_option("--every", o->every,
                   "Use only every N-th row and column of a grid, starting with row and column 0. "
                   "A larger N takes less time, but gives fewer observations")
      ->check(cli::PositiveNumber);
  command
      ->add_option("--references", o->features.references,
                   "Number of reference cameras. Corners are detected in their images, and then searched for in the "
                   "images of all other cameras. More reference cameras give more tracks, but take more time")
      ->check(cli::Range(1, static_cast<int>(lf::kMaxCameras)));
  command
      ->add_option("--features", o->features.features,
                   "Maximum number of corners to detect in the image of each "
                   "reference camera. More corners give more tracks, but take "
                   "more time")
      ->check(cli::Range(1, 1000000));
  command
      ->add_option("--least-cameras", o->features.least_cameras,
                   "Minimum number of cameras that must see a corner. Corners that fewer cameras see are discarded. A "
                   "larger value keeps fewer, but more reliable corners")
      ->check(cli::Range(2, static_cast<int>(lf::kMaxCameras)));
  command->add_option("--out", o->out, "JSON file that receives the tracks, for lf-calibrate solve")->required();
  command->callback([o] { find_features(*o); });
}

}  // namespace

int main(int argc, char** argv) {
  cli::App app(
      "Calibrates the cameras of an array: their lenses, positions, orientations and colours, with uncertainties. "
      "lf-calibrate all runs all steps; the other commands run single steps",
      "lf-calibrate");
  app.require_subcommand(1);
  lf::capture_solver_messages();
  add_all_command(app);
  add_boards_command(app);
  add_check_command(app);
  add_colour_command(app);
  add_features_command(app);
  add_intrinsics_command(app);
  add_report_command(app);
  add_solve_command(app);
  add_track_command(app);
  // If standard output is a log file, the file also receives the error.
  return cli::run_tool(app, argc, argv, {}, [](const std::string& error) {
    struct stat out = {};
    if (fstat(STDOUT_FILENO, &out) == 0 && S_ISREG(out.st_mode)) terminal::print("error: %s\n", error.c_str());
    // Messages of the solver may explain a failure, but are useless otherwise.
    for (const std::string& message : lf::solver_messages())
      terminal::print_error("note: solver message: %s\n", message.c_str());
  });
}
