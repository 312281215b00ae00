// SPDX-License-Identifier: LGPL-2.1-or-later
#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "calibration/colour_samples.h"
#include "calibration/colour_solve.h"
#include "composite/still.h"
#include "focus/still_focus.h"
#include "image/colour_correction.h"
#include "quality/image_quality.h"
#include "rig/rig_json.h"
#include "scene/calibration_targets.h"
#include "scene/scene.h"
#include "support/run_program.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

class ColourCommand : public testing::Test {
 protected:
  Outcome scene(const std::string& arguments) { return run_program("../tools/lf-scene", arguments, dir_.path()); }
  Outcome colour(const std::string& arguments) {
    return run_program("lf-calibrate", "colour " + arguments, dir_.path());
  }
  nlohmann::json json(const std::string& name) const { return parse_json(read_text_file(dir_ / name), name); }

  const TempDir dir_;
};

TEST_F(ColourCommand, MeasuresAndCorrectsWithAChart) {
  save_rig(scene_rig(2, 2, 320, 240), dir_ / "rig.json");
  test::expect_outcome(scene("chart --rig rig.json --out chart --places 10 --faults 3 --stuck 1"), 0);
  const Outcome outcome = colour("rig.json --recording chart/rig.json --out out.json --json report.json");
  ASSERT_EQ(outcome.status, 0) << outcome.output;
  EXPECT_THAT(outcome.output, AllOf(HasSubstr("uncorrected"), HasSubstr("<- chosen"), mentions("4 of 4 cameras")));
  EXPECT_THAT(outcome.output, mentions("camera 1", "cam_00_01", "exposure"));
  const nlohmann::json report = json("report.json");
  EXPECT_EQ(report["format"], "lightfield-colour-report");
  EXPECT_THAT(report["from"].get<std::string>(), HasSubstr("charts"));
  EXPECT_GT(report["before"]["p95"].get<double>(), 8);
  EXPECT_LE(report["after"]["median"].get<double>(), 1) << outcome.output;
  EXPECT_LE(report["after"]["p95"].get<double>(), 3) << outcome.output;
  for (size_t i = 0; i < 4; i++) EXPECT_EQ(report["cameras"][i]["stuck"], i == 1);

  const Rig rig = load_rig(dir_ / "out.json");
  const nlohmann::json truth = json("chart/colours.json");
  for (size_t i = 0; i < 4; i++) {
    ASSERT_TRUE(rig.cameras[i].colour);
    EXPECT_EQ(rig.cameras[i].image, "") << "the recording does not match the rig";
    if (i == 1) continue;
    // At the image corners.
    const double k1 = truth["cameras"][i]["vignetting"][0], k2 = truth["cameras"][i]["vignetting"][1];
    const double lost = std::pow(1 + k1 + k2, -1 / truth["cameras"][i]["gamma"].get<double>());
    EXPECT_NEAR(level_factor(vignetting_factor(*rig.cameras[i].colour, 1)) / lost, 1, 0.03) << "camera " << i;
  }
}

// Realistic recordings: cameras with different rates; the chart rests at each position for a second.
TEST_F(ColourCommand, RecordingsAreSampledOverTheirWholeLength) {
  save_rig(scene_rig(2, 2, 320, 240), dir_ / "rig.json");
  ASSERT_EQ(scene("chart --rig rig.json --out places --places 10 --faults 3").status, 0);
  std::filesystem::create_directory(dir_ / "film");
  for (const Camera& camera : load_rig(dir_ / "rig.json").cameras) {
    const std::string line =
        "gst-launch-1.0 -q filesrc location='" + (dir_ / "places/" + camera.name) +
        ".mkv' ! matroskademux ! image/jpeg ! videorate ! image/jpeg,framerate=" + (camera.id % 2 ? "15" : "30") +
        "/1 ! matroskamux ! filesink location='" + (dir_ / "film/" + camera.name) + ".mkv'";
    ASSERT_EQ(std::system(line.c_str()), 0) << line;
  }
  const Outcome outcome = colour("rig.json --recording film --frames 10 --out out.json --json report.json");
  ASSERT_EQ(outcome.status, 0) << outcome.output;
  EXPECT_LE(json("report.json")["after"]["p95"].get<double>(), 3) << outcome.output;
  const Rig rig = load_rig(dir_ / "out.json");
  const nlohmann::json truth = json("places/colours.json");
  for (size_t i = 0; i < 4; i++) {
    const double k1 = truth["cameras"][i]["vignetting"][0], k2 = truth["cameras"][i]["vignetting"][1];
    const double lost = std::pow(1 + k1 + k2, -1 / truth["cameras"][i]["gamma"].get<double>());
    ASSERT_TRUE(rig.cameras[i].colour);
    EXPECT_NEAR(level_factor(vignetting_factor(*rig.cameras[i].colour, 1)) / lost, 1, 0.02) << "camera " << i;
  }

  // An unreadable recording is reported with the reason and does not affect the rest.
  dir_.write("film/cam_00_01.mkv", "this is no video");
  test::expect_outcome(colour("rig.json --recording film --frames 10 --out three.json"), 0,
                       AllOf(mentions("camera 1", "no frame"), mentions("3 of 4 cameras")));
}

TEST_F(ColourCommand, WorksWithoutAChart) {
  ASSERT_EQ(scene("--out film --grid 3x3 --width 240 --height 180 --frames 1 --format png --faults 5").status, 0);
  const Outcome outcome = colour("film/rig.json --out film/rig.json --json report.json");
  ASSERT_EQ(outcome.status, 0) << outcome.output;
  const nlohmann::json report = json("report.json");
  EXPECT_EQ(report["from"], "overlapping views") << "no chart";
  EXPECT_GT(report["before"]["median"].get<double>(), 4);
  EXPECT_LE(report["after"]["median"].get<double>(), 1) << outcome.output;
  EXPECT_LE(report["after"]["p95"].get<double>(), 3) << outcome.output;
  EXPECT_TRUE(load_rig(dir_ / "film/rig.json").has_colour());
  // Measuring again gives the same result: corrections in the rig are not applied twice.
  const Rig before = load_rig(dir_ / "film/rig.json");
  ASSERT_EQ(colour("film/rig.json --out again.json").status, 0);
  const Rig again = load_rig(dir_ / "again.json");
  for (size_t i = 0; i < 9; i++)
    for (const Vec3& level : {Vec3(60, 80, 100), Vec3(200, 150, 120)})
      EXPECT_LE(glm::length(corrected(*again.cameras[i].colour, level) - corrected(*before.cameras[i].colour, level)),
                0.01);
}

TEST_F(ColourCommand, ErrorsNameTheRemedy) {
  save_rig(scene_rig(2, 2, 160, 120), dir_ / "rig.json");
  Outcome outcome = colour("rig.json --out out.json");
  EXPECT_NE(outcome.status, 0);
  EXPECT_THAT(outcome.output, mentions("rig.json", "frame", "--recording"));

  ASSERT_EQ(scene("--out film --grid 2x2 --width 160 --height 120 --frames 1 --format png").status, 0);
  outcome = colour("film/rig.json --from chart --out out.json");
  EXPECT_NE(outcome.status, 0);
  EXPECT_THAT(outcome.output, mentions("no frame", "colour chart"));

  save_rig(scene_rig(2, 2, 320, 240), dir_ / "large.json");
  outcome = colour("large.json --recording film/rig.json --out out.json");
  EXPECT_NE(outcome.status, 0);
  EXPECT_THAT(outcome.output, mentions("160x120", "320x240"));

  // One camera of the recording is missing, another is black.
  Rig film = load_rig(dir_ / "film/rig.json");
  film.cameras[2].source = film.cameras[2].image = "";
  save_image(Image(PixelFamily::kRgb, 160, 120), dir_ / "film/black.png");
  film.cameras[3].source = film.cameras[3].image = "black.png";
  save_rig(film, dir_ / "film/part.json");
  outcome = colour("film/rig.json --recording film/part.json --from views --out out.json");
  EXPECT_THAT(outcome.output, mentions("camera 2", "no frame"));
  EXPECT_NE(outcome.status, 0) << "two cameras are too few for places that three see";
  EXPECT_FALSE(std::filesystem::exists(dir_ / "out.json"));
}

TEST_F(ColourCommand, HelpListsTheOptions) {
  test::expect_outcome(colour("--help"), 0,
                       AllOf(HasSubstr("--recording"), HasSubstr("--from"), HasSubstr("--frames")));
}

// Returns the PSNR of a picture through the focal surface found in `images`, against the scene.
double surface_db(const Rig& rig, const std::vector<Image>& images, const View& view, const Image& truth) {
  const Mesh mesh = build_mesh(rig);
  const CameraImages image_of = [&](CameraIndex i) -> const Image& { return images[i]; };
  const View focused = focus_still(rig, mesh, view, image_of, {.mode = FocusMode::kSurface});
  const Still still = render_still(rig, mesh, focused, image_of, Resampling::kSharpened);
  return compare(still.picture, truth, still.coverage).psnr_db;
}

TEST(ColourQuality, GainErrorsCostLittleAfterCorrection) {
  const Rig rig = scene_rig(4, 4, 320, 240);
  std::vector<Image> good, wrong;
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    const Camera& camera = rig.cameras[i];
    good.push_back(render_scene({camera.width, camera.height, camera.lens, camera.pose}, 0));
    wrong.push_back(apply_fault(good.back(), {.gain = i % 4 == 1 ? 1.1 : 1.0}, camera.principal_point(), i));
  }
  const ColourSolution solution = solve_colours(rig, sample_views(rig, wrong));
  EXPECT_EQ(solution.terms, ColourTerms()) << "brightness alone is off: " << solution.terms.name();
  // Gains are relative to the majority of cameras. Corrections target the mean camera, so the truth is brighter by the
  // same factor.
  for (size_t i = 0; i < solution.cameras.size(); i++)
    EXPECT_NEAR(solution.cameras[i].gain, i % 4 == 1 ? 1.1 : 1, 0.01) << i;

  View view{.width = 320,
            .height = 240,
            .lens = rig.cameras[0].lens,
            .pose = {{0.013, -0.008, 0}, {1, 0, 0, 0}},
            .focus = {}};
  view.focus.plane = plane_through({0, 0, kSceneMiddle}, {0, 0, 1});
  const Image truth = render_scene({view.width, view.height, view.lens, view.pose}, 0);
  ColourFault all{.gain = std::pow(1.1, 0.25)};
  const Image brighter = apply_fault(truth, all, {159.5, 119.5}, 0);
  std::vector<Image> corrected_images, equal;
  for (size_t i = 0; i < wrong.size(); i++) {
    corrected_images.push_back(corrected(wrong[i], *solution.models[i], rig.cameras[i].principal_point()));
    equal.push_back(apply_fault(good[i], all, {159.5, 119.5}, i));
  }
  const double best = surface_db(rig, equal, view, brighter), with_faults = surface_db(rig, wrong, view, brighter),
               after = surface_db(rig, corrected_images, view, brighter);
  RecordProperty("psnr_db", "equal " + std::to_string(best) + ", off " + std::to_string(with_faults) + ", corrected " +
                                std::to_string(after));
  EXPECT_LE(with_faults, best - 1) << "clear improvement";
  EXPECT_GE(after, best - 0.3);
}

}  // namespace
}  // namespace lf
