// SPDX-License-Identifier: LGPL-2.1-or-later
#include <csignal>

#include <glog/logging.h>
#include <nlohmann/json.hpp>

#include "calibration/simulator.h"
#include "rig/rig_json.h"
#include "solver_log.h"
#include "support/run_program.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

sim::ArrayOptions small_array() {
  sim::ArrayOptions array;
  array.rows = array.columns = 3;
  return array;
}

TEST(SolveCommand, WritesRigAndReport) {
  const TempDir dir;
  const Rig truth = sim::make_array(small_array(), 1);
  sim::PathOptions path;
  path.bar = 0.3;
  dir.write("tracks.json", tracks_to_json(sim::watch(truth, path, 2).tracks));
  test::expect_outcome(
      run_program("lf-calibrate", "solve --tracks tracks.json --bar 0.3 --out rig.json --json report.json", dir.path()),
      0, mentions("rig.json", "9 of 9 cameras"));
  const Rig rig = load_rig(dir / "rig.json");
  std::vector<Pose> found, expected;
  for (size_t i = 0; i < 9; i++) found.push_back(rig.cameras[i].pose), expected.push_back(truth.cameras[i].pose);
  const Similarity s = align(found, expected);
  EXPECT_NEAR(s.scale, 1, 0.03);
  for (size_t i = 0; i < 9; i++) EXPECT_LE(glm::length(s(found[i]).position - expected[i].position), 0.01);
  const std::string name = dir / "rig.json";
  const nlohmann::json json = parse_json(read_text_file(name), name);
  for (const JsonValue& camera : JsonValue(json, name).at("cameras").elements()) {
    const auto covariance = parse_camera_covariance(camera);
    ASSERT_TRUE(covariance);
    EXPECT_TRUE(covariance->index_of("rz"));
  }
  const nlohmann::json report = parse_json(read_text_file(dir / "report.json"), "report.json");
  for (const char* key : {"mean_px", "median_px", "rms_px", "expected_rms_px", "observations", "outliers"})
    EXPECT_TRUE(report.at(key).is_number()) << key;
  EXPECT_EQ(report.at("cameras").size(), 9u);
  EXPECT_TRUE(report.at("model").is_string());
  EXPECT_EQ(report.at("scale_from"), "the bar's length");
}

TEST(SolveCommand, ErrorsLeaveNoRig) {
  const TempDir dir;
  const auto expect_failure = [&](const std::string& options, const std::vector<std::string>& facts) {
    test::expect_outcome(run_program("lf-calibrate", "solve --out rig.json " + options, dir.path()), 1,
                         mentions(facts));
    EXPECT_FALSE(std::filesystem::exists(dir / "rig.json"));
  };
  dir.write("bad.json", R"({"format": "lightfield-tracks", "version": 1, "cameras": 3})");
  expect_failure("--tracks bad.json", {"bad.json", "cameras", "array"});
  expect_failure("--tracks none.json", {"does not exist"});
  const Rig truth = sim::make_array(small_array(), 1);
  Tracks tracks = sim::watch(truth, {}, 2).tracks;
  dir.write("tracks.json", tracks_to_json(tracks));
  expect_failure("--tracks tracks.json --bar 1", {"tracks", "one light"});
  expect_failure("--tracks tracks.json --distance 1,2", {"two camera ids", "distance"});
  Rig other = truth;
  other.cameras[4].width = 100;
  save_rig(other, dir / "other.json");
  expect_failure("--tracks tracks.json --prior other.json", {"camera 4", "320x240", "tracks"});
  tracks.observations.clear();
  dir.write("empty.json", tracks_to_json(tracks));
  expect_failure("--tracks empty.json", {"two cameras", "light"});
}

TEST(SolveCommand, InterruptionKeepsThePreviousRig) {
  const TempDir dir;
  sim::PathOptions path;
  path.bar = 0.3;
  dir.write("tracks.json", tracks_to_json(sim::watch(sim::make_array({}, 1), path, 2).tracks));
  dir.write("rig.json", "as it was");
  for (const char* what : {"first layout: disparities", "lenses", "distortion"}) {
    int ends[2];
    ASSERT_EQ(pipe(ends), 0);
    const pid_t child = fork();
    if (child == 0) {
      dup2(ends[1], STDERR_FILENO);
      if (chdir(dir.path().c_str()) == 0)
        execl(LF_TOOLS_DIR "/lf-calibrate", "lf-calibrate", "solve", "--tracks", "tracks.json", "--out", "rig.json",
              "--json", "report.json", nullptr);
      _exit(127);
    }
    close(ends[1]);
    FILE* progress = fdopen(ends[0], "r");
    std::string seen;
    for (char line[256]; fgets(line, sizeof line, progress);) {
      seen += line;
      if (line != std::string(what) + "\n") continue;
      kill(child, SIGINT);
      break;
    }
    int status = 0;
    waitpid(child, &status, 0);
    fclose(progress);
    EXPECT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGINT) << what << " of\n" << seen;
    EXPECT_EQ(read_text_file(dir / "rig.json"), "as it was") << what;
    std::set<std::string> files;
    for (const auto& entry : std::filesystem::directory_iterator(dir.path())) files.insert(entry.path().filename());
    EXPECT_EQ(files, (std::set<std::string>{"rig.json", "tracks.json"})) << what;
  }
}

TEST(SolverLog, SolverMessagesDoNotReachStderr) {
  capture_solver_messages();
  testing::internal::CaptureStderr();
  for (int i = 0; i < 3; i++) LOG(WARNING) << "Linear solver failure";
  LOG(ERROR) << "Residual is not finite";
  google::FlushLogFiles(google::GLOG_INFO);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_THAT(solver_messages(),
              testing::UnorderedElementsAre("Linear solver failure (3 times)", "Residual is not finite"));
}

}  // namespace
}  // namespace lf
