// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-calibrate solve: positions, orientations and lenses from the tracks of a moving light.
#include <memory>
#include <string>

#include "base/error.h"
#include "calibration/tracks_json.h"
#include "commands.h"

namespace {

struct Options {
  std::string tracks, prior, out, json, distortion = "auto";
};

void solve(const Options& options) {
  const lf::Tracks tracks = lf::load_tracks(options.tracks);
  throw lf::Error("solve: not there yet for " + std::to_string(tracks.cameras.size()) + " cameras");
}

}  // namespace

void add_solve_command(CLI::App& app) {
  const auto o = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("solve", "Positions, orientations and lenses from tracks of a moving light");
  command->add_option("--tracks", o->tracks, "Tracks (JSON)")->required();
  command->add_option("--out", o->out, "Rig file to write")->required();
  command->callback([o] { solve(*o); });
}
