// SPDX-License-Identifier: LGPL-2.1-or-later
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "base/file.h"
#include "support/photographs.h"
#include "support/run_program.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

class LfRender : public testing::Test {
 protected:
  LfRender() {
    // 2x3 cameras, each with a uniform grey; ids from 10.
    rig_ = test::camera_grid(2, 3, 0.1, 40, 30, 40, 10);
    for (int i = 0; i < 6; i++) {
      rig_.cameras[i].name = "cam" + std::to_string(i);
      rig_.cameras[i].image = rig_.cameras[i].name + ".png";
      save_image(grey(grey_of(i)), path(rig_.cameras[i].image));
    }
    save_rig(rig_, path("rig.json"));
  }

  static int grey_of(int camera) { return 40 + 30 * camera; }
  static Image grey(int value, int width = 40, int height = 30) {
    Image image(PixelFamily::kRgb, width, height);
    std::fill(image.data().begin(), image.data().end(), static_cast<uint8_t>(value));
    return image;
  }
  NamedView view_at(const std::string& name, int camera) const {
    const Camera& c = rig_.cameras[camera];
    return {name, 0, {c.width, c.height, c.lens, c.pose, {plane_through({0, 0, 5}, {0, 0, 1})}}};
  }
  std::string path(const std::string& name) const { return folder_ / name; }

  int run(const std::string& more = "", const std::string& rig = "rig.json") {
    const Outcome outcome =
        run_program("lf-render", "--rig " + rig + " --views views.json --out 'out folder' " + more, folder_.path());
    output_ = outcome.output;
    return outcome.status;
  }
  std::string text(const std::string& name) const { return read_text_file(path(name)); }
  void expect_failure(const std::string& more, const std::vector<std::string>& parts,
                      const std::string& rig = "rig.json") {
    EXPECT_EQ(run(more, rig), 1) << parts[0];
    EXPECT_EQ(std::count(output_.begin(), output_.end(), '\n'), 1) << output_;
    EXPECT_THAT(output_, mentions(parts));
  }
  static void expect_grey(const Image& image, int value, int tolerance) {
    for (const uint8_t v : image.data()) ASSERT_NEAR(v, value, tolerance);
  }
  Image picture(const std::string& name) const { return load_image(path("out folder/" + name + ".png")); }

  TempDir folder_;
  Rig rig_;
  std::string output_;
};

TEST_F(LfRender, WritesPicturesTableAndJson) {
  save_views({view_at("left", 0), view_at("right", 5)}, path("views.json"));
  fs::create_directories(path("truth"));
  save_image(grey(grey_of(0)), path("truth/left.png"));
  save_image(grey(grey_of(5) - 10), path("truth/right.png"));
  ASSERT_EQ(run("--truth '" + path("truth") + "' --json '" + path("figures.json") + "'"), 0) << output_;
  expect_grey(picture("left"), grey_of(0), 1);
  expect_grey(picture("right"), grey_of(5), 1);
  for (const char* word : {"view", "psnr_db", "ssim", "coverage", "left", "right", "mean"})
    EXPECT_THAT(output_, HasSubstr(word));

  const nlohmann::json json = nlohmann::json::parse(text("figures.json"));
  ASSERT_EQ(json["views"].size(), 2u);
  const nlohmann::json& right = json["views"][1];
  EXPECT_EQ(right["name"], "right");
  EXPECT_NEAR(right["psnr_db"].get<double>(), 20 * std::log10(255 / 10.0), 0.9);
  EXPECT_NEAR(right["max_error"].get<int>(), 10, 1);
  EXPECT_GT(right["ssim"].get<double>(), 0.98);
  EXPECT_EQ(right["coverage"], 1);
  EXPECT_GE(right["cameras"].get<int>(), 1);
  EXPECT_GT(right["ms"].get<double>(), 0);
  EXPECT_EQ(json["mean"]["coverage"], 1);
  EXPECT_FALSE(json["mean"].contains("name"));
}

TEST_F(LfRender, FiguresAreNullWithoutTruth) {
  save_views({view_at("v", 0)}, path("views.json"));
  ASSERT_EQ(run("--json '" + path("figures.json") + "'"), 0) << output_;
  const nlohmann::json json = nlohmann::json::parse(text("figures.json"));
  for (const char* key : {"psnr_db", "ssim", "max_error"}) {
    EXPECT_TRUE(json["views"][0][key].is_null());
    EXPECT_TRUE(json["mean"][key].is_null());
  }
}

TEST_F(LfRender, CamerasOutOfServiceDoNotContribute) {
  save_views({view_at("v", 0)}, path("views.json"));
  ASSERT_EQ(run("--cameras 13"), 0) << output_;
  EXPECT_EQ(picture("v").pixel(20, 15)[0], grey_of(3));
  ASSERT_EQ(run("--cameras 10,13"), 0) << output_;
  EXPECT_NEAR(picture("v").pixel(20, 15)[0], grey_of(0), 6);
}

TEST_F(LfRender, UsesEveryNthCamera) {
  save_views({view_at("v", 1)}, path("views.json"));
  ASSERT_EQ(run("--every 2"), 0) << output_;
  EXPECT_NEAR(picture("v").pixel(20, 15)[0], (grey_of(0) + grey_of(2)) / 2, 4);
}

TEST_F(LfRender, UsesTheRequestedCamerasPerPixel) {
  save_views({view_at("v", 0)}, path("views.json"));
  for (const char* family : {"", " --i420"}) {
    ASSERT_EQ(run(std::string("--nearest-cameras 2") + family), 0) << output_;
    expect_grey(picture("v"), grey_of(0), 1);
    ASSERT_EQ(run(std::string("--aperture 5") + family), 0) << output_;
    EXPECT_NEAR(picture("v").pixel(20, 15)[0], (grey_of(0) + grey_of(5)) / 2, 2);
  }
  expect_failure("--aperture -1", {"blending", "aperture", "0"});
  expect_failure("--nearest-cameras 33", {"blending", "1 to 32"});
  expect_failure("--nearest-cameras 3 --aperture 1", {"--aperture"});
}

TEST_F(LfRender, I420MakesTheSamePicture) {
  save_views({view_at("v", 2)}, path("views.json"));
  ASSERT_EQ(run("--i420"), 0) << output_;
  expect_grey(picture("v"), grey_of(2), 2);
}

TEST_F(LfRender, EveryRendererMakesTheSamePicture) {
  save_views({view_at("v", 2)}, path("views.json"));
  for (const std::string renderer : {"gl", "auto", "cpu"}) {
    ASSERT_EQ(run("--renderer " + renderer), 0) << output_;
    expect_grey(picture("v"), grey_of(2), 2);
  }
}

TEST_F(LfRender, OddTinyAndEmptyViews) {
  NamedView tiny = view_at("tiny", 0), odd = view_at("odd", 0), away = view_at("away", 0);
  tiny.view.width = tiny.view.height = 1;
  odd.view.width = 3;
  odd.view.height = 101;
  away.view.pose.orientation = Quat(0, 0, 1, 0);
  save_views({tiny, odd, away}, path("views.json"));
  for (const char* family : {"", "--i420"}) {
    ASSERT_EQ(run(family), 0) << output_;
    EXPECT_EQ(picture("tiny").width(), 1);
    EXPECT_EQ(picture("odd").height(), 101);
    EXPECT_EQ(picture("away").data(), Image(PixelFamily::kRgb, 40, 30).data());
  }
}

TEST_F(LfRender, ErrorsNameFileAndPlace) {
  save_views({view_at("v", 0)}, path("views.json"));
  expect_failure("", {"no.json", "can't be read"}, "no.json");
  folder_.write("half.json", text("rig.json").substr(0, 300));
  expect_failure("", {"half.json: cameras[", "not valid JSON"}, "half.json");
  expect_failure("--cameras 10,99", {"\"99\"", "id 99"});
  expect_failure("--every 0", {"every"});
  expect_failure("--truth '" + path("nowhere") + "'", {"nowhere/v.png", "no such"});
  expect_failure("--no-such-option", {"lf-render: ", "--no-such-option"});

  save_image(grey(0, 41, 30), path("cam0.png"));
  expect_failure("", {"camera 10 (cam0): ", "cam0.png", "41x30", "40x30"});
  fs::remove(path("cam0.png"));
  expect_failure("", {"camera 10 (cam0): ", "cam0.png", "no such"});

  folder_.write("views.json", R"({"format": "lightfield-views", "version": 1, "views": []})");
  expect_failure("", {"views.json: views"});
  save_views({view_at("../v", 0)}, path("views.json"));
  expect_failure("", {"views.json: views[0].name: "});
}

TEST(LfRenderFocus, FocusesAutomaticallyByDefault) {
  const TempDir folder;
  Rig rig = scene_rig(4, 4, 160, 120);
  test::save_photographs(rig, folder, 0.5);
  NamedView view{"v", 0.5, {160, 120, rig.cameras[0].lens, {}, {}}};
  view.view.pose.position = {0.003, -0.002, 0};
  view.view.focus.plane = focal_plane_at(view.view.pose, kSceneMiddle);
  save_views({view}, folder / "views.json");
  save_image(render_scene({160, 120, view.view.lens, view.view.pose}, 0.5), folder / "v.png");
  const auto psnr = [&](const std::string& more) {
    test::expect_outcome(
        run_program("lf-render", "--rig rig.json --views views.json --truth . --out out --json out.json " + more,
                    folder.path()),
        0);
    return nlohmann::json::parse(read_text_file(folder / "out.json"))["mean"]["psnr_db"].get<double>();
  };
  const double plane = psnr("--focus plane"), sharp = psnr(""), bilinear = psnr("--resampling bilinear");
  std::printf("plane %.1f dB, default %.1f dB, with bilinear samples %.1f dB\n", plane, sharp, bilinear);
  EXPECT_GT(sharp, plane + 4);
  EXPECT_GT(sharp, bilinear + 0.2);
}

TEST(LfRenderFocus, WritesDepths) {
  const TempDir folder;
  Rig rig = scene_rig(4, 4, 160, 120);
  test::save_photographs(rig, folder, 0.5);
  NamedView view{"v", 0.5, {160, 120, rig.cameras[0].lens, {}, {}}};
  view.view.focus.plane = focal_plane_at(view.view.pose, kSceneMiddle);
  save_views({view}, folder / "views.json");
  const auto depths = [&](const std::string& more) {
    test::expect_outcome(
        run_program("lf-render", "--rig rig.json --views views.json --out out --depth --ply --gltf " + more,
                    folder.path()),
        0);
    const cv::Mat png = cv::imread(folder / "out/v.depth.png", cv::IMREAD_UNCHANGED);
    EXPECT_EQ(png.type(), CV_16UC1);
    EXPECT_EQ(png.size(), cv::Size(160, 120));
    EXPECT_EQ(fs::file_size(folder / "out/v.depth.pfm"), std::string("Pf\n160 120\n-1\n").size() + 160 * 120 * 4);
    EXPECT_GT(fs::file_size(folder / "out/v.ply"), 15u * 160 * 120 / 2);
    EXPECT_GT(fs::file_size(folder / "out/v.glb"), 20u * 40 * 30);
    EXPECT_EQ(read_file(folder / "out/v.glb").substr(0, 4), "glTF");
    const cv::Mat confidence = cv::imread(folder / "out/v.confidence.png", cv::IMREAD_UNCHANGED);
    EXPECT_EQ(confidence.type(), CV_8UC1);
    EXPECT_EQ(confidence.size(), png.size());
    const int confident = cv::countNonZero(confidence > 127);
    EXPECT_TRUE(more.empty() ? confident > 160 * 120 / 4 : confident == 0) << confident << more;
    double least = 0, most = 0;
    cv::minMaxLoc(png, &least, &most, nullptr, nullptr, png > 0);  // the cameras do not see all corners
    EXPECT_GT(cv::countNonZero(png), 160 * 120 / 2);
    return std::pair(least, most);
  };
  const auto plane = depths("--focus plane"), surface = depths("");
  EXPECT_NEAR(plane.first, 1000 * kSceneMiddle, 1);
  EXPECT_NEAR(plane.second, 1000 * kSceneMiddle, 1);
  EXPECT_GT(surface.second, 1.5 * surface.first) << "the mannequin and the wall";
}

// A misaligned camera does not fit the prediction from its neighbours.
TEST(LfRenderLeaveOneOut, NamesTheFaultyCamera) {
  const TempDir folder;
  Rig rig = scene_rig(5, 5, 80, 60);
  test::save_photographs(rig, folder, 0.5, 1);
  rig.cameras[6].name = "row/one";  // COLMAP's names may contain slashes
  rig.cameras[7].name = "../above";
  rig.cameras[8].name = rig.cameras[9].name = "row_one";
  rig.cameras[10].name = "row_one_2";
  const std::string off = rig.cameras[12].name;
  rig.cameras[12].pose.orientation = glm::angleAxis(0.05, Vec3(0, 1, 0));
  save_rig(rig, folder / "rig.json");
  const auto run = [&](const std::string& more) {
    const Outcome outcome = run_program("lf-render", "--rig rig.json --leave-one-out --out out " + more, folder.path());
    EXPECT_EQ(outcome.status, 0) << outcome.output;
    return outcome.output;
  };
  const std::string said = run("--focus surface --focus-near 1 --focus-far 6 --json out.json");
  EXPECT_THAT(said, mentions(off, "another direction"));
  EXPECT_EQ(said.find("stands out"), said.rfind("stands out")) << "one alone: " << said;
  for (const char* name :
       {"out/row_one.png", "out/.._above.png", "out/row_one_2.png", "out/row_one_3.png", "out/row_one_4.png"})
    EXPECT_TRUE(std::filesystem::exists(folder / name)) << name;
  EXPECT_GT(nlohmann::json::parse(read_text_file(folder / "out.json"))["mean"]["psnr_db"].get<double>(), 20);
  EXPECT_THAT(run("--focus surface --focus-near 1 --focus-far 6 --i420"), mentions(off, "another direction"));
  rig.cameras[12].pose.orientation = {1, 0, 0, 0};
  save_rig(rig, folder / "rig.json");
  EXPECT_EQ(run("--focus surface --focus-near 1 --focus-far 6").find("stands out"), std::string::npos);
}

TEST(LfRenderLeaveOneOut, ReversedRangeIsAnError) {
  test::expect_outcome(
      run_program("lf-render", "--rig rig.json --leave-one-out --out out --focus-near 5 --focus-far 1"), testing::Ne(0),
      mentions("--focus-near", "--focus-far"));
}

}  // namespace
}  // namespace lf
