// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-calibrate all: from recordings to a rig and a report, and its errors for unusable recordings.

#include <nlohmann/json.hpp>

#include "calibration/simulator.h"
#include "rig/rig_json.h"
#include "support/run_program.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

// Recordings shared by all tests: four cameras, a bar, a chart.
class AllCommand : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    material_ = std::make_unique<TempDir>();
    save_rig(scene_rig(2, 2, 240, 180), *material_ / "rig.json");
    for (const char* arguments : {"lights --rig rig.json --out lights --framerate 15 --seconds 6",
                                  "chart --rig rig.json --out chart --places 8 --faults 3"}) {
      test::expect_outcome(run_program("../tools/lf-scene", arguments, material_->path()), 0);
    }
  }
  static void TearDownTestSuite() { material_.reset(); }

  AllCommand() {
    fs::copy(material_->path(), dir_.path(), fs::copy_options::recursive);
    const Rig rig = load_rig(dir_ / "rig.json");
    for (const Camera& camera : rig.cameras) names_.push_back(camera.name);
  }
  Outcome all(const std::string& arguments) {
    return run_program("lf-calibrate", "all rig.json " + arguments, dir_.path());
  }
  std::string light(int camera) const { return dir_ / "lights/" + names_[static_cast<size_t>(camera)] + ".mkv"; }

  static std::unique_ptr<TempDir> material_;
  const TempDir dir_;
  std::vector<std::string> names_;
};
std::unique_ptr<TempDir> AllCommand::material_;

TEST_F(AllCommand, RepeatsOnlyStepsWithChangedInputs) {
  const std::string arguments = "--lights lights --bar 0.3 --colour chart --out field.json";
  test::expect_outcome(all(arguments), 0,
                       AllOf(mentions("tracks.json", "4 of 4 cameras"), mentions("geometry.json", "4 of 4 cameras"),
                             mentions("4 of 4", "corrected"), HasSubstr("report      "), HasSubstr("field/report.html"),
                             Not(HasSubstr("as before"))));
  const Rig rig = load_rig(dir_ / "field.json");
  EXPECT_EQ(rig.cameras.size(), 4u);
  EXPECT_TRUE(rig.has_colour());
  EXPECT_THAT(read_text_file(dir_ / "field/report.html"), AllOf(HasSubstr("Colours"), HasSubstr("Residuals")));
  EXPECT_EQ(read_text_file(dir_ / "rig.json"), read_text_file(*material_ / "rig.json"));

  const auto written = fs::last_write_time(dir_ / "field.json");
  const Outcome again = all(arguments);
  EXPECT_EQ(again.status, 0) << again.output;
  EXPECT_THAT(again.output, AllOf(HasSubstr("track       as before: "), HasSubstr("solve       as before: "),
                                  HasSubstr("colour      as before: ")));
  EXPECT_EQ(fs::last_write_time(dir_ / "field.json"), written) << "unchanged, so watchers do not read it again";

  fs::last_write_time(dir_ / "chart/rig.json", fs::file_time_type::clock::now());
  const Outcome other = all(arguments);
  EXPECT_THAT(other.output, AllOf(HasSubstr("track       as before: "), HasSubstr("solve       as before: "),
                                  Not(HasSubstr("colour      as before: "))));
  fs::remove(dir_ / "field/geometry.json");
  EXPECT_THAT(all(arguments).output,
              AllOf(HasSubstr("track       as before: "), Not(HasSubstr("solve       as before: "))));
}

// The cameras loop the recordings.
TEST_F(AllCommand, PromptsAndRecordsLiveCameras) {
  setenv("GST_PLUGIN_PATH", (fs::path(LF_TOOLS_DIR) / "../gst").c_str(), 0);
  Rig rig = load_rig(dir_ / "rig.json");
  for (Camera& camera : rig.cameras) camera.source = "lights/" + camera.name + ".mkv", camera.time_offset = 0;
  rig.cameras[3].source = "lights/none.mkv";
  save_rig(rig, dir_ / "rig.json");
  dir_.write("enter", "\n");
  const std::string arguments = "all rig.json --record 4 --lights live --bar 0.3";
  test::expect_outcome(
      run_program("lf-calibrate", arguments + " <enter", dir_.path()), 1,
      AllOf(mentions("both lights", "Enter"), HasSubstr("Recording now."), mentions("light", "covered"),
            HasSubstr("camera 3 (cam_01_01): "), HasSubstr("check the path"), mentions("tracks.json", "3 of 4 cameras"),
            HasSubstr("report.html")));
  const Outcome again = run_program("lf-calibrate", arguments + " <enter", dir_.path());
  EXPECT_THAT(again.output, AllOf(mentions("live", "recordings", "Enter"), HasSubstr("track       as before"),
                                  Not(HasSubstr("Recording now."))));
  for (Camera& camera : rig.cameras) camera.source = "videotestsrc is-live=true ! tee name=t t. ! queue";
  save_rig(rig, dir_ / "rig.json");
  const std::string briefly = "all rig.json --record 0.2 --lights other --bar 0.3";
  EXPECT_THAT(run_program("lf-calibrate", briefly + " <enter", dir_.path()).output, mentions("source", "tee"));
  EXPECT_THAT(run_program("lf-calibrate", briefly + " --trust-rig <enter", dir_.path()).output,
              Not(HasSubstr("source has tee")));
  test::expect_outcome(run_program("lf-calibrate", arguments + " </dev/null", dir_.path()), 1,
                       mentions("--record", "standard input"));
}

// Asks for boards pose by pose; for cameras that see no board, the lights determine the lenses.
TEST_F(AllCommand, PromptsForBoardPoses) {
  setenv("GST_PLUGIN_PATH", (fs::path(LF_TOOLS_DIR) / "../gst").c_str(), 0);
  Rig rig = load_rig(dir_ / "rig.json");
  for (Camera& camera : rig.cameras) camera.source = "lights/" + camera.name + ".mkv", camera.time_offset = 0;
  save_rig(rig, dir_ / "rig.json");
  dir_.write("enter", "\n\n");
  const Outcome outcome =
      run_program("lf-calibrate",
                  "all rig.json --record 1 --lights lights --boards boards --board 9x6 --bar 0.3 <enter", dir_.path());
  EXPECT_THAT(outcome.output,
              AllOf(mentions("lights", "recordings", "Enter"), mentions("9x6", "Enter"), mentions("1/12", "middle"),
                    mentions("12/12", "first distance"), Not(HasSubstr("light has covered"))));
  for (const std::string& name : names_) EXPECT_TRUE(fs::exists(dir_ / "boards/" + name + ".mkv")) << name;
  EXPECT_THAT(outcome.output, mentions("no image", "9x6"));
  EXPECT_EQ(outcome.status, 0) << outcome.output;
}

void make_video(const std::string& path, const std::string& source) {
  const std::string line = "gst-launch-1.0 -q " + source +
                           " ! video/x-raw,width=240,height=180,framerate=15/1 ! jpegenc ! matroskamux ! filesink "
                           "location='" +
                           path + "'";
  ASSERT_EQ(std::system(line.c_str()), 0) << line;
}

TEST_F(AllCommand, ErrorsNameTheRemedy) {
  const auto all_lights = [&](const std::string& source) {
    for (int i = 0; i < 4; i++) make_video(light(i), source);
  };
  const struct {
    const char* what;
    std::function<void()> spoil;
    const char* arguments;
    int status;
    std::vector<const char*> said;
  } cases[] = {
      {"one camera is black",
       [&] { make_video(light(1), "videotestsrc num-buffers=60 pattern=black"); },
       "--lights lights --bar 0.3",
       1,
       {"3 of 4 cameras", "(with errors)", "1 camera of 4", "attention", "lens", "report.html"}},
      {"no light",
       [&] { all_lights("videotestsrc num-buffers=30 pattern=solid-color foreground-color=0xff202020"); },
       "--lights lights",
       1,
       {"two cameras", "moving light", "bright enough", "report.html"}},
      {"a room that is not dark",
       [&] { all_lights("videotestsrc num-buffers=30 pattern=solid-color foreground-color=0xff909090"); },
       "--lights lights",
       1,
       {"not dark", "curtains"}},
      {"another rig's recordings",
       [&] { fs::rename(light(2), dir_ / "lights/other.mkv"); },
       "--lights lights --bar 0.3",
       1,
       {"no recording", "cam_01_00.*"}},
      {"no folder", [] {}, "--lights nowhere", 1, {"nowhere:", "not a folder"}},
      {"a board without its size", [] {}, "--lights lights --boards chart", 1, {"--boards:", "--board"}},
      {"the wrong board",
       [] {},
       "--lights lights --bar 0.3 --boards chart --board 9x6",
       0,
       {"no image", "9x6", "boards-0    failed"}},
      {"no chart", [] {}, "--lights lights --bar 0.3 --colour nowhere", 0, {"colours", "nowhere"}},
      {"onto itself", [] {}, "--lights lights --out rig.json", 1, {"another file", "--out"}},
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(c.what);
    fs::remove_all(dir_ / "lights");
    fs::copy(*material_ / "lights", dir_ / "lights", fs::copy_options::recursive);
    c.spoil();
    const Outcome outcome = all(c.arguments);
    EXPECT_EQ(outcome.status, c.status) << outcome.output;
    for (const char* said : c.said) EXPECT_THAT(outcome.output, HasSubstr(said));
    if (HasFailure()) return;
  }
}

// An array that deviates from its plan records a bar, a chart and the built-in scene. Pictures with the calibrated rig
// must have the same quality as pictures with the true rig.
TEST(CalibrationRun, PicturesMatchTheTrueRig) {
  const TempDir dir;
  const sim::PlannedArray array(3, 3, 240, 180);
  save_rig(array.truth, dir / "true.json");
  save_rig(array.nominal, dir / "nominal.json");
  for (const char* filmed : {"lights --rig true.json --out lights --framerate 30,15 --seconds 9,8 --noise 3 "
                             "--exposure 0.012 --reflection 0.3",
                             "chart --rig true.json --out colours --faults 7 --stuck 8"}) {
    test::expect_outcome(run_program("../tools/lf-scene", filmed, dir.path()), 0);
  }
  const Outcome all = run_program(
      "lf-calibrate", "all nominal.json --lights lights --bar 0.3 --colour colours --out rig.json", dir.path());
  EXPECT_EQ(all.status, 1) << "the stuck camera needs attention";
  EXPECT_THAT(all.output, mentions("camera 8", "cam_02_02", "exposure"));
  EXPECT_THAT(all.output, Not(HasSubstr(" levels after correction"))) << "a misread chart is no camera fault";
  ASSERT_TRUE(std::filesystem::exists(dir / "rig.json")) << all.output;
  const Rig found = load_rig(dir / "rig.json");
  const nlohmann::json colours = parse_json(read_text_file(dir / "rig/colour.json"), "colour.json");
  EXPECT_LE(colours["after"]["median"].get<double>(), 1);
  EXPECT_LE(colours["after"]["p95"].get<double>(), 3);
  const double clocks = array.clock_error(found);
  EXPECT_LE(clocks, 5e-4);  // seconds

  const auto best = array.shown_db(array.truth_with_colours_of(found)), calibrated = array.shown_db(found),
             planned = array.shown_db(array.nominal);
  for (size_t eye = 0; eye < best.size(); eye++) {
    std::printf("true rig %.2f dB, calibrated %.2f, nominal %.2f; clocks %.3f ms\n", best[eye], calibrated[eye],
                planned[eye], 1e3 * clocks);
    EXPECT_GE(calibrated[eye], best[eye] - 1);
    EXPECT_LE(planned[eye], best[eye] - 3) << "calibration improves the rig";
  }
}

}  // namespace
}  // namespace lf
