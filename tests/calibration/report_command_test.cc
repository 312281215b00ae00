// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-calibrate report: a page of what the steps said.
#include <filesystem>

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

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class ReportCommand : public testing::Test {
 protected:
  Outcome run(const std::string& arguments) { return run_program("lf-calibrate", arguments, dir_.path()); }
  std::string page() const { return read_text_file(dir_ / "report.html"); }
  // solve.json of a rig whose camera 4 saw nothing, or saw all.
  void solve(bool blind) {
    sim::ArrayOptions array;
    array.rows = array.columns = 3;
    sim::PathOptions path;
    path.bar = 0.3;
    Tracks tracks = sim::watch(sim::make_array(array, 1), path, 2).tracks;
    if (blind) std::erase_if(tracks.observations, [](const Observation& o) { return o.camera == 4; });
    dir_.write("tracks.json", tracks_to_json(tracks));
    const Outcome solved = run("solve --tracks tracks.json --bar 0.3 --out rig.json --json solve.json");
    ASSERT_EQ(solved.status, blind ? 1 : 0) << solved.output;
  }

  const TempDir dir_;
};

TEST_F(ReportCommand, OnePageThatNeedsNothingBesides) {
  solve(false);
  const Outcome outcome = run("report solve.json --title \"A <rig> & more\"");
  ASSERT_EQ(outcome.status, 0) << outcome.output;
  EXPECT_THAT(outcome.output, HasSubstr("report.html: "));
  const std::string html = page();
  EXPECT_THAT(html, AllOf(HasSubstr("A &lt;rig&gt; &amp; more"), HasSubstr("<svg "), HasSubstr("What to do next"),
                          HasSubstr("prefers-color-scheme: dark")));
  // Nothing is fetched.
  EXPECT_THAT(html, Not(HasSubstr("http")));
  EXPECT_THAT(html, Not(HasSubstr("src=")));
  EXPECT_THAT(html, Not(HasSubstr("<script")));
  EXPECT_THAT(html, Not(HasSubstr("nan")));
  for (const char* part : {"Residuals", "Coverage", "ellipsoids", "where lights were", "How deep the scene is"})
    EXPECT_THAT(html, HasSubstr(part));
}

TEST_F(ReportCommand, ACameraThatIsMissingIsTheFirstThingSaid) {
  solve(true);
  const Outcome outcome = run("report solve.json");
  ASSERT_EQ(outcome.status, 0) << outcome.output;
  EXPECT_THAT(outcome.output, HasSubstr("1 camera of 9 needs you"));
  EXPECT_THAT(outcome.output, HasSubstr("- camera 4: never saw the light"));
  EXPECT_THAT(page(), AllOf(HasSubstr("1 camera of 9 needs you"), HasSubstr("badge bad"), HasSubstr("8 of 9")));
}

TEST_F(ReportCommand, ColoursAndChecksJoinByTheirCameras) {
  solve(false);
  dir_.write("colour.json", R"({"format": "lightfield-colour-report", "version": 1, "from": "12 charts",
      "terms": "brightness", "before": {"median": 5.9, "p95": 18.7}, "after": {"median": 0.67, "p95": 2.6},
      "trials": [{"terms": "brightness", "held_out": {"median": 0.7, "p95": 2.7}}],
      "findings": [{"severity": "warning", "code": "stuck-exposure", "text": "camera 2 (cam_2): its exposure is stuck"}],
      "cameras": [{"id": 2, "corrected": true, "gain": 1.6, "rms": 1, "clipped": 0.3, "stuck": true},
                  {"id": 3, "corrected": true, "gain": 1.02, "rms": 0.6, "clipped": 0, "stuck": false}]})");
  dir_.write("check.json", R"({"format": "lightfield-check", "version": 1, "from": "monitor", "holds": false,
      "findings": [{"severity": "error", "code": "moved", "text": "camera 7 (cam_7) looks elsewhere"}],
      "cameras": [{"id": 7, "name": "cam_7", "state": "moved", "shift_px": 6}]})");
  const Outcome outcome = run("report solve.json colour.json check.json");
  ASSERT_EQ(outcome.status, 0) << outcome.output;
  EXPECT_THAT(outcome.output, HasSubstr("The rig no longer holds"));
  EXPECT_THAT(outcome.output,
              AllOf(HasSubstr("- camera 7 cam_7: looks elsewhere"), HasSubstr(": its exposure is stuck")));
  EXPECT_THAT(page(), AllOf(HasSubstr("Since then"), HasSubstr("What the running monitor says"), HasSubstr("18.7")));
}

TEST_F(ReportCommand, WhatIsNoReportIsRefused) {
  dir_.write("tracks.json", R"({"format": "lightfield-tracks"})");
  dir_.write("damaged.json", R"({"format": "lightfield-check", "findings": [], "cameras": [{"id": "x"}]})");
  dir_.write("text.json", "what");
  const struct {
    const char *arguments, *said;
  } cases[] = {
      {"tracks.json", "tracks.json: is no report of lf-calibrate: give what --json of track, solve, colour and check"},
      {"damaged.json", "damaged.json: is damaged, or of another version: run its step again"},
      {"text.json", "text.json"},
      {"nowhere.json", "nowhere.json"},
      {"", "FILE"},
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(c.arguments);
    const Outcome outcome = run(std::string("report ") + c.arguments);
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.output, HasSubstr(c.said));
    EXPECT_FALSE(std::filesystem::exists(dir_ / "report.html"));
  }
}

}  // namespace
}  // namespace lf
