// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-calibrate check as people run it: later tracks and recordings, and what the running monitor says.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "calibration/simulator.h"
#include "calibration/tracks.h"
#include "rig/rig_json.h"
#include "support/run_program.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

using testing::HasSubstr;
using testing::Not;

class CheckCommand : public testing::Test {
 protected:
  CheckCommand() {
    sim::ArrayOptions options;
    options.rows = options.columns = 3;
    rig_ = sim::make_array(options, 4);
    save_rig(rig_, dir_ / "rig.json");
  }
  Outcome check(const std::string& arguments) {
    return run_program("lf-calibrate", "check rig.json " + arguments, dir_.path());
  }
  // Tracks of the cameras as they are now.
  void film(const Rig& now) {
    sim::PathOptions path;
    path.bar = 0.3, path.noise = 0.05;
    dir_.write("tracks.json", tracks_to_json(sim::watch(now, path, 9).tracks));
  }
  // The monitor's words, with a fault of camera 4.
  void write_monitor(const char* fault) {
    nlohmann::json cameras = nlohmann::json::array();
    for (size_t i = 0; i < 9; i++) {
      const bool corner = i == 0 || i == 2 || i == 6 || i == 8, odd = i == 4 && *fault != 0;
      nlohmann::json camera = {{"name", rig_.cameras[i].name},
                               {"psnr", 30},
                               {"gain", odd ? 1.08 : 1.0},
                               {"shift", odd ? 1.5 : 0.02},
                               {"fault", nullptr}};
      if (corner) camera["psnr"] = camera["gain"] = camera["shift"] = nullptr;
      if (odd) camera["fault"] = fault;
      cameras.push_back(camera);
    }
    dir_.write("monitor.json", nlohmann::json({{"turns", 90}, {"bytes", 1}, {"cameras", cameras}}).dump());
  }

  const TempDir dir_;
  Rig rig_;
};

TEST_F(CheckCommand, TheExitStatusSaysWhetherItHolds) {
  film(rig_);
  const Outcome holds = check("--tracks tracks.json --bar 0.3 --json check.json");
  EXPECT_EQ(holds.status, 0) << holds.output;
  EXPECT_THAT(holds.output, HasSubstr("rig.json holds: 9 of 9 cameras are where it says"));
  EXPECT_THAT(holds.output, HasSubstr("bar         300."));

  Rig now = rig_;
  now.cameras[4].pose.orientation = now.cameras[4].pose.orientation * glm::angleAxis(0.01, Vec3(0, 1, 0));
  film(now);
  const Outcome moved = check("--tracks tracks.json --json check.json");
  EXPECT_EQ(moved.status, 1) << moved.output;
  EXPECT_THAT(moved.output, HasSubstr("camera 4 (cam_01_01) has moved, its picture by 4."));
  EXPECT_THAT(moved.output, HasSubstr("turned by 0.57 to the right"));
  EXPECT_THAT(moved.output, HasSubstr("rig.json does not hold: 1 of 9 cameras are off"));
  const nlohmann::json report = parse_json(read_text_file(dir_ / "check.json"), "check.json");
  EXPECT_EQ(report["format"], "lightfield-check");
  EXPECT_EQ(report["cameras"][4]["state"], "moved");
  EXPECT_NEAR(report["cameras"][4]["turn_deg"][1].get<double>(), 0.573, 0.02);
  EXPECT_EQ(report["cameras"][3]["state"], "holds");
}

TEST_F(CheckCommand, TheMonitorIsAskedToo) {
  const struct {
    const char* fault;
    int status;
    const char* said;
  } cases[] = {
      {"", 0, "rig.json holds: 5 of 9 cameras"},
      {"direction", 1, "camera 4 (cam_01_01) looks elsewhere than the rig says: its picture is off by 6 pixels or so"},
      {"colour", 0, "camera 4 (cam_01_01) is 8 % brighter than the others: lock its exposure"},
      {"picture", 0, "is it out of focus, dirty or covered?"},
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(c.fault);
    write_monitor(c.fault);
    const Outcome outcome = check("--monitor monitor.json");
    EXPECT_EQ(outcome.status, c.status) << outcome.output;
    EXPECT_THAT(outcome.output, HasSubstr(c.said));
  }
}

TEST_F(CheckCommand, WhereNothingCanBeToldItSaysWhatToDo) {
  film(rig_);
  Rig other = rig_;
  other.cameras[3].id = 70;
  save_rig(other, dir_ / "other.json");
  Tracks dark = parse_tracks(read_text_file(dir_ / "tracks.json"), "tracks.json");
  dark.observations.clear();
  dir_.write("dark.json", tracks_to_json(dark));
  write_monitor("");
  nlohmann::json early = parse_json(read_text_file(dir_ / "monitor.json"), "monitor.json");
  early["cameras"] = nlohmann::json::array();
  dir_.write("early.json", early.dump());
  std::filesystem::create_directory(dir_ / "empty");
  const struct {
    const char *arguments, *said;
  } cases[] = {
      {"rig.json --tracks dark.json", "no three cameras see the light where this rig lets them"},
      {"other.json --tracks tracks.json", "camera 3 of the recording is not in the rig"},
      {"rig.json --recordings empty", "fewer than three cameras saw a moving light"},
      {"rig.json --recordings nowhere", "nowhere: is no folder"},
      {"rig.json --tracks rig.json", "rig.json"},
      {"rig.json --monitor early.json", "has looked at no camera yet: start lf-serve with --monitor 30"},
      {"rig.json --monitor http://127.0.0.1:1", "is lf-serve running there?"},
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(c.arguments);
    const Outcome outcome = run_program("lf-calibrate", std::string("check ") + c.arguments, dir_.path());
    EXPECT_EQ(outcome.status, 2) << outcome.output;
    EXPECT_THAT(outcome.output, HasSubstr(c.said));
    EXPECT_THAT(outcome.output, Not(HasSubstr("holds: ")));
  }
  EXPECT_EQ(check("").status, 2) << "nothing is asked";
}

}  // namespace
}  // namespace lf
