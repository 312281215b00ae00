// SPDX-License-Identifier: LGPL-2.1-or-later

#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "image/image.h"
#include "support/run_program.h"
#include "support/temp_dir.h"
#include "view/view_path.h"

namespace lf {
namespace {

constexpr const char* kProgram = "../tests/bench/bench-surface";  // relative to the tools folder

class BenchSurface : public testing::Test {
 protected:
  nlohmann::json row(const std::string& name) const {
    test::expect_outcome(
        run_program(kProgram, "--acceptance --most-views 1 --only '" + name + "' --json row.json", folder_.path()), 0);
    return nlohmann::json::parse(read_text_file(folder_ / "row.json"))["rows"][0];
  }
  TempDir folder_;
};

TEST_F(BenchSurface, FlatSceneIsAsSharpAsItsPlaneAtLittleCost) {
  const nlohmann::json flat = row("flat");
  EXPECT_GT(flat["rest_gain_db"], -0.1) << "the same picture";
  EXPECT_LT(flat["rest_percent"], 2) << "of the bytes of a picture";
  EXPECT_GT(flat["gain_db"], -0.5);
  EXPECT_GT(flat["worst_on_way_db"], -0.5);
  EXPECT_LE(flat["flicker_median"], 1);
}

TEST_F(BenchSurface, ThinObjectsAreNoWorseThanThroughAPlane) {
  const nlohmann::json wires = row("wires");
  EXPECT_GT(wires["gain_db"], 0);
  EXPECT_GT(wires["worst_on_way_db"], -0.3);
  EXPECT_GT(wires["rest_gain_db"], 0);
  EXPECT_LT(wires["rest_percent"], 5);
  EXPECT_LE(wires["flicker_median"], 1);
}

TEST_F(BenchSurface, BuiltInSceneGainsAndThenRests) {
  const nlohmann::json scene = row("built-in scene");
  EXPECT_GT(scene["gain_db"], 6.5);
  EXPECT_GT(scene["rest_gain_db"], 6.5);
  EXPECT_LT(scene["rest_percent"], 5);
  EXPECT_GE(scene["worst_on_way_db"], -0.1);
  EXPECT_LE(scene["flicker_median"], 1);
  EXPECT_LT(scene["surface_bytes"], 1.2 * static_cast<double>(scene["plane_bytes"]));
  EXPECT_GT(scene["surface_ssim"], scene["plane_ssim"]);
}

// Without gains, the surface gains 2.6 dB, the same at rest, and flickers by 16 of 255 (99th percentile).
TEST_F(BenchSurface, BrightnessDifferencesCostLittle) {
  const nlohmann::json matched = row("built-in scene, gains off by 10 %");
  EXPECT_GT(matched["gain_db"], 7);
  EXPECT_GT(matched["rest_gain_db"], 6.5);
  EXPECT_LT(matched["rest_percent"], 5);
  EXPECT_LT(matched["flicker_p99"], 11);
}

// 5x5 cameras 8 mm apart, with a scene from 1.2 m: disparities up to 4 pixels, or 8 between every second camera.
class NarrowArray : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TempDir>();
    // One view looks ahead, and one where no camera looks.
    View ahead{.width = 160,
               .height = 120,
               .lens = Lens::from_fov_y(40, 160, 120),
               .pose = {{0.004, 0.004, 0}, {1, 0, 0, 0}},
               .focus = {}},
        back = ahead;
    back.pose.orientation = {0, 0, 1, 0};
    for (View* view : {&ahead, &back}) view->focus.plane = focal_plane_at(view->pose, 2);
    save_views({{"back", 0, back}, {"ahead", 0, ahead}}, *folder_ / "views.json");
    run("lf-rig", "new --grid 5x5 --pitch 0.008 --fov 40 --width 320 --height 240 --out nominal.json");
    run("lf-scene", "--rig nominal.json --frames 1 --format png --truth views.json --out array");
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static std::string run(const std::string& program, const std::string& arguments, int status = 0) {
    const Outcome outcome = run_program(program, arguments, folder_->path());
    EXPECT_EQ(outcome.status, status) << outcome.output;
    return outcome.output;
  }
  static nlohmann::json figures(const std::string& arguments) {
    const std::string output = run(kProgram, arguments + " --json figures.json");
    EXPECT_THAT(output, Not(HasSubstr("nan")));
    return nlohmann::json::parse(read_text_file(*folder_ / "figures.json"));
  }
  static inline std::unique_ptr<TempDir> folder_;
};

TEST_F(NarrowArray, NeedsNoDepths) {
  const std::string rig = "--rig array/rig.json --held-out 2 --resampling sharpened";
  const nlohmann::json given = figures(rig + " --near 1.14 --far 4.95")["mean"], found = figures(rig)["mean"];
  EXPECT_NEAR(found["plane_db"].get<double>(), given["plane_db"].get<double>(), 0.05);
  EXPECT_NEAR(found["gain_db"].get<double>(), given["gain_db"].get<double>(), 0.3);
  EXPECT_GT(given["gain_db"], 3);
  EXPECT_NEAR(found["plane_at"].get<double>(), given["plane_at"].get<double>(), 0.1);
  EXPECT_LT(found["near"], 1.3) << "metres: the nearest thing is at 1.2";
  EXPECT_GT(found["far"], 4) << "the wall is at 4.5";
}

TEST_F(NarrowArray, NeedsNoGrid) {
  run("lf-rig", "subset array/rig.json --cameras 0,2,4,10,12,14,18,20,22,24 --out scattered.json");
  const nlohmann::json json = figures("--rig scattered.json --out pictures");
  ASSERT_EQ(json["views"].size(), 2u) << "the two that others surround";
  EXPECT_EQ(json["views"][0]["name"], "cam_02_02");
  EXPECT_EQ(json["views"][1]["name"], "cam_03_03");
  for (const nlohmann::json& view : json["views"]) EXPECT_GT(view["gain_db"], 1) << view["name"];
  for (const char* name : {"cam_03_03_surface.png", "cam_02_02_map.png", "speed.gp"})
    EXPECT_TRUE(std::filesystem::exists(*folder_ / (std::string("pictures/") + name))) << name;
}

// Closer than half a metre, few images overlap; at 1 cm, none.
TEST_F(NarrowArray, InvisiblePlanesDoNotAffectOtherPlanes) {
  const nlohmann::json wide = figures("--rig array/rig.json --held-out 1 --rounds 2 --near 0.01 --far 5")["mean"],
                       given = figures("--rig array/rig.json --held-out 1 --rounds 2 --near 1.14 --far 4.95")["mean"];
  ASSERT_TRUE(wide["plane_db"].is_number());
  EXPECT_LT(wide["plane_db"], given["plane_db"]) << "32 planes are few for that";
  const nlohmann::json none = figures("--rig array/rig.json --held-out 1 --rounds 2 --near 0.0001 --far 0.0002");
  for (const char* name : {"plane_db", "surface_db", "gain_db", "bound_db", "plane_ssim"}) {
    EXPECT_TRUE(none["mean"][name].is_null()) << name;
    EXPECT_TRUE(none["views"][0][name].is_null()) << name;
  }
}

TEST_F(NarrowArray, InvisibleViewsAreLeftOut) {
  const std::string views = "--rig array/rig.json --views views.json --truth array/truth --rounds 2";
  for (const std::string range : {"", " --near 1.14 --far 4.95"}) {
    const nlohmann::json json = figures(views + range);
    for (const char* name : {"plane_db", "surface_db", "gain_db", "bound_db"}) {
      EXPECT_TRUE(json["views"][0][name].is_null()) << name;
      EXPECT_EQ(json["mean"][name], json["views"][1][name]) << name;
    }
    EXPECT_GT(json["mean"]["plane_db"], 20);
  }
}

TEST_F(NarrowArray, UnmeasurableRigsAreErrors) {
  EXPECT_THAT(run(kProgram, "--rig nominal.json", 1), mentions("camera 0", "no image"));
  run("lf-rig", "subset array/rig.json --cameras 0,1,5,6 --out four.json");
  EXPECT_THAT(run(kProgram, "--rig four.json", 1), mentions("cameras (4)", "between"));
  std::filesystem::copy(*folder_ / "array/truth", *folder_ / "small");
  save_image(Image(PixelFamily::kRgb, 8, 6), *folder_ / "small/ahead.png");
  const std::string views = "--rig array/rig.json --views views.json --truth ";
  EXPECT_THAT(run(kProgram, views + "small", 1), mentions("ahead.png", "8x6", "160x120"));
  EXPECT_THAT(run(kProgram, views + "array", 1), mentions("back.png", "no such"));
  EXPECT_THAT(run(kProgram, "--rig array/rig.json --near 3 --far 2", 1), HasSubstr("nearer"));
}

TEST_F(BenchSurface, UnknownScenesAreErrors) {
  test::expect_outcome(run_program(kProgram, "--acceptance --only nowhere", folder_.path()), testing::Ne(0),
                       mentions("none", "scenes"));
}

}  // namespace
}  // namespace lf
