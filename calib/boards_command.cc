// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-calibrate boards: poses and lenses of several cameras from recordings of a calibration board.
#include <cmath>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gst/gst.h>
#include <nlohmann/json.hpp>

#include "base/maths.h"
#include "base/text.h"
#include "board_recordings.h"
#include "commands.h"
#include "recordings.h"
#include "solution_output.h"
#include "terminal.h"

namespace {

using nlohmann::json;

struct BoardsArguments {
  std::string recordings, prior, out, json;
  BoardOptions board;
  BoardSearch search{.threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()))};
};

// Returns the cameras of a folder without a rig file; their sizes are not known yet.
lf::Rig rig_of_folder(const std::string& folder) {
  lf::Rig rig;
  for (const std::string& name : board_cameras(folder)) {
    lf::Camera& camera = rig.cameras.emplace_back();
    camera.id = static_cast<uint32_t>(rig.cameras.size() - 1);
    camera.name = name;
    camera.width = camera.height = 0;
  }
  if (rig.cameras.size() < 2)
    throw lf::Error(folder +
                    ": has recordings of fewer than two cameras. Each camera needs a video NAME.* or a folder "
                    "NAME with pictures");
  if (rig.cameras.size() > lf::kMaxCameras)
    throw lf::Error(folder + ": has recordings of " + std::to_string(rig.cameras.size()) + " cameras, the maximum is " +
                    std::to_string(lf::kMaxCameras));
  return rig;
}

void print_recordings(const lf::Rig& rig, const BoardRecordings& found) {
  terminal::print("%-8s %-16s %8s %7s %9s\n", "camera", "name", "pictures", "boards", "coverage");
  for (size_t i = 0; i < rig.cameras.size(); i++)
    terminal::print("%-8u %-16s %8zu %7zu %7.0f %%\n", rig.cameras[i].id, rig.cameras[i].name.c_str(),
                    found.cameras[i].pictures, found.cameras[i].views, 100 * found.cameras[i].coverage);
}

// True if the frames that were searched are not the frames around the instants, according to the estimated clocks.
bool searched_elsewhere(const BoardRecordings& found, const lf::MovingBoardSolution& solved) {
  std::vector<double> moves;
  for (size_t i = 0; i < found.clocks.size(); i++) moves.push_back(solved.clocks[i].offset - found.clocks[i].offset);
  const double common = lf::median(moves);
  for (size_t i = 0; i < moves.size(); i++)
    if (solved.clocks[i].known && std::abs(moves[i] - common) > found.films.frame_times[i]) return true;
  return false;
}

void calibrate(const BoardsArguments& o) {
  gst_init(nullptr, nullptr);
  const lf::CalibrationBoard board = parse_board(o.board);
  lf::SolveOptions options;
  json original = json::object();
  if (!o.prior.empty()) original = load_prior(o.prior, options);
  const lf::Rig rig = options.prior ? *options.prior : rig_of_folder(o.recordings);
  BoardRecordings found = detect_boards(rig, o.recordings, board, o.search, options);
  print_recordings(rig, found);

  SolveProgress progress("solving", options.progress);
  lf::MovingBoardSolution solved;
  if (found.has_films) {
    constexpr int kMaxSearches = 3;
    for (int search = 1;; search++) {
      solved = lf::solve_moving_board(found.films, found.instants, found.clocks, options);
      if (search == kMaxSearches || !searched_elsewhere(found, solved)) break;
      found = detect_boards(rig, o.recordings, board, o.search, options, solved.clocks);
    }
  } else {
    static_cast<lf::BoardSolution&>(solved) = lf::solve_boards(found.sightings, options);
  }
  SolvedCameras cameras{solved.solution, solved.tracks, options};
  if (found.has_films) cameras.boards = &solved;
  if (!options.prior)
    for (const lf::Camera& camera : rig.cameras) cameras.names.push_back(camera.name);
  save_solution(cameras, std::move(original), "lf-calibrate boards", o.out, o.json, progress);
}

}  // namespace

void add_boards_command(cli::App& app) {
  const auto o = std::make_shared<BoardsArguments>();
  cli::App* command = app.add_subcommand(
      "boards",
      "Estimates the positions, orientations and lenses of all cameras from recordings of a checkerboard, a ChArUco "
      "board or an AprilGrid that several cameras see at the same time");
  command
      ->add_option("RECORDINGS", o->recordings,
                   "Folder with a video NAME.* or a folder NAME of pictures for each camera. Videos need timestamps of "
                   "one clock, or --reach; pictures of one instant have the same number at the end of their names")
      ->required()
      ->type_name("DIR");
  add_board_options(*command, o->board, true);
  command
      ->add_option("--prior", o->prior,
                   "Rig file with the names of the cameras, their lenses, optionally with covariances, and their "
                   "nominal positions (default: the cameras are named after their recordings)")
      ->type_name("RIG");
  command
      ->add_option("--instants", o->search.instants,
                   "Number of instants at which videos are searched for the board, spread over their length. More "
                   "instants give a better result, but take more time")
      ->check(cli::Range(3, 10000));
  command
      ->add_option(
          "--reach", o->search.reach,
          "Largest difference between the clocks of videos, or between their starts, in seconds. The motion of "
          "the board tells the differences. 0: timestamps of one clock, to about a frame")
      ->check(cli::Range(0.0, 600.0));
  command->add_option("--out", o->out, "Rig file to write, with the estimated cameras")->required()->type_name("RIG");
  command->add_option("--json", o->json, "JSON file that receives the report, for lf-calibrate report")
      ->type_name("FILE");
  command
      ->add_option("--threads", o->search.threads,
                   "Number of recordings to search at the same time. More recordings use more processors and memory")
      ->check(cli::Range(1, 256));
  command->callback([o] { calibrate(*o); });
}
