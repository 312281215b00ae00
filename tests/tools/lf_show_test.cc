// SPDX-License-Identifier: LGPL-2.1-or-later
// Runs lf-show with a small array in the built-in scene: all images, and errors.
#include "support/photographs.h"
#include "support/recorded.h"
#include "support/run_program.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

class LfShow : public testing::Test {
 protected:
  void SetUp() override {
    rig_ = scene_rig(4, 4, 96, 72);
    test::save_photographs(rig_, folder_, 0, 1);
  }
  std::string path(const std::string& name) const { return folder_ / name; }
  Outcome run(const std::string& arguments) const { return run_program("lf-show", arguments, folder_.path()); }
  void save_path(double step) const {
    std::vector<View> views;
    for (int i = 0; i < 3; i++) views.push_back(test::view_from({step * i, 0, 0}, 48, 36, 30, 2));
    save_views(test::path_of(views, 0), path("v.json"));
  }
  Image picture(const std::string& arguments) const {
    test::expect_outcome(run(arguments + " --rig rig.json --out out.png"), 0);
    return load_image(path("out.png"));
  }
  void expect_failure(const std::string& arguments, const std::vector<std::string>& facts) const {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.status, 1) << arguments;
    EXPECT_EQ(std::count(outcome.output.begin(), outcome.output.end(), '\n'), 1) << outcome.output;
    EXPECT_THAT(outcome.output, mentions(facts));
  }
  static int light(const Image& image, int x, int y) {
    return image.pixel(x, y)[0] + image.pixel(x, y)[1] + image.pixel(x, y)[2];
  }
  static int count(const Image& image, const Rect& part, int least) {
    int n = 0;
    for (int y = part.y0; y < part.y1; y++)
      for (int x = part.x0; x < part.x1; x++) n += light(image, x, y) >= least;
    return n;
  }

  TempDir folder_;
  Rig rig_;
};

TEST_F(LfShow, MosaicShowsEachImageAndName) {
  rig_.cameras[5].image.clear();
  save_rig(rig_, path("rig.json"));
  const Image mosaic = picture("mosaic --width 400");
  ASSERT_EQ(mosaic.width(), 400);
  ASSERT_EQ(mosaic.height(), 300);
  EXPECT_GT(count(mosaic, {0, 0, 100, 60}, 150), 3000);
  EXPECT_EQ(count(mosaic, {100, 75, 200, 135}, 150), 0) << "camera without an image";
  EXPECT_GT(count(mosaic, {100, 135, 200, 150}, 600), 50) << "camera name";
}

TEST_F(LfShow, ShowsContributionsFromTheViewAndFromBehind) {
  const Image eye = picture("contributions --focus plane");
  EXPECT_GT(count(eye, {4, 4, 92, 68}, 60), 80 * 60) << "cameras cover the home view";
  const Image behind = picture("contributions --behind --size 200x150 --ids");
  ASSERT_EQ(behind.width(), 200);
  EXPECT_EQ(count(behind, {0, 0, 200, 14}, 1), 0) << "margin of a tenth of the view";
  EXPECT_GT(count(behind, {40, 20, 160, 130}, 60), 4000);
  expect_failure("contributions --rig rig.json --behind --views v.json --out o.png", {"--behind"});
}

TEST_F(LfShow, CoverageDistinguishesMissingWeightFromNoCamera) {
  const Image all = picture("coverage --focus plane");
  EXPECT_EQ(all.width(), 96);
  EXPECT_GT(all.height(), 72) << "a scale below";
  EXPECT_NEAR(all.pixel(48, 36)[0], all.pixel(48, 36)[1], 6) << "no missing weight: dim and grey";
  // The cameras do not cover the outer parts of a wide view.
  EXPECT_EQ(picture("coverage --focus plane --fov 90").pixel(2, 2)[2], heat_colour(1)[2]);
  const Image beside = picture("coverage --focus plane --move 0.05,0,-0.3");
  EXPECT_NE(light(beside, 94, 36), 3 * kNoValueGrey) << "pixels beside the mesh are extrapolated";
}

TEST_F(LfShow, ShowsEpipolarImagesOfARowAndAColumn) {
  const Image row = picture("epi --row 1 --focus-distance 2.2 --stripe 4");
  EXPECT_EQ(row.width(), 96);
  EXPECT_EQ(row.height(), 16);
  for (int x = 0; x < 96; x++) EXPECT_EQ(light(row, x, 0), light(row, x, 3)) << "a camera's stripe";
  const Image column = picture("epi --column 0 --width 50");
  EXPECT_EQ(column.width(), 50);
  EXPECT_EQ(column.height(), 64);
  expect_failure("epi --rig rig.json --out o.png", {"--row or --column"});
  expect_failure("epi --rig rig.json --out o.png --row 4", {"row 4", "0 to 3"});
}

TEST_F(LfShow, SweepFocusesOnSuccessivePlanes) {
  ASSERT_EQ(run("sweep --rig rig.json --near 1 --far 5 --planes 3 --out s_%02d.png").status, 0);
  EXPECT_TRUE(fs::exists(path("s_00.png")) && fs::exists(path("s_01.png")) && fs::exists(path("s_02.png")));
  EXPECT_NE(load_image(path("s_00.png")).data(), load_image(path("s_02.png")).data());
  test::expect_outcome(run("sweep --rig rig.json --planes 4 --out s.mkv"), 0, HasSubstr("4 planes from "));
  EXPECT_GT(fs::file_size(path("s.mkv")), 2000u);
  expect_failure("sweep --rig rig.json --out s.png", {"numbered"});
  expect_failure("sweep --rig rig.json --out s.avi", {"--out s.avi", "NAME.png"});
  expect_failure("sweep --rig rig.json --out s_%s.png", {"--out s_%s.png", "NAME.png"});
}

TEST_F(LfShow, ShowsDifferencesFromTheTruth) {
  test::expect_outcome(run("difference --rig rig.json --scene --out scene.png"), 0, HasSubstr("PSNR 2"));
  test::expect_outcome(run("difference --rig rig.json --held-out-camera 5 --out left.png"), 0, HasSubstr("PSNR "));
  // The view of a corner camera is extrapolated.
  test::expect_outcome(run("difference --rig rig.json --held-out-camera 0 --out corner.png"), 0,
                       AllOf(HasSubstr("left out"), HasSubstr("PSNR 2")));
  const Camera& camera = rig_.cameras[6];
  save_views({{"at", 0, {96, 72, camera.lens, camera.pose, {focal_plane_at(camera.pose, 2)}}}}, path("v.json"));
  const std::string same = "difference --rig rig.json --views v.json --focus plane --out same.png --truth ";
  test::expect_outcome(run(same + camera.image), 0, HasSubstr("SSIM 1.0000"));
  EXPECT_EQ(count(load_image(path("same.png")), {0, 0, 96, 72}, 20), 0);
  expect_failure("difference --rig rig.json --out o.png", {"--truth", "--scene", "--held-out-camera"});
  expect_failure("difference --rig rig.json --out o.png --held-out-camera 99", {"99"});
  expect_failure("difference --rig rig.json --out o.png --size 40x30 --truth " + camera.image, {"same size", "view"});
}

TEST_F(LfShow, WritesAFilmOfAPath) {
  save_path(0.02);
  ASSERT_EQ(run("contributions --rig rig.json --views v.json --focus plane --out c_%d.png").status, 0);
  EXPECT_TRUE(fs::exists(path("c_2.png")));
  EXPECT_EQ(run("coverage --rig rig.json --views v.json --focus plane --out c.mkv").status, 0);
  EXPECT_TRUE(fs::exists(path("c.mkv")));
}

TEST_F(LfShow, ErrorsNameTheOptionOrTheFile) {
  expect_failure("mosaic --rig nowhere.json --out o.png", {"nowhere.json"});
  expect_failure("coverage --rig rig.json --size 0x3 --out o.png", {"--size 0x3", "WIDTHxHEIGHT"});
  expect_failure("coverage --rig rig.json --move 1,2 --out o.png", {"--move", "three numbers"});
  for (Camera& camera : rig_.cameras) camera.image.clear();
  save_rig(rig_, path("bare.json"));
  expect_failure("mosaic --rig bare.json --out o.png", {"lf-rig snapshot"});
  for (const char* command : {"mosaic", "contributions", "coverage", "epi", "sweep", "difference"})
    EXPECT_EQ(run(std::string(command) + " --help").status, 0) << command;
}

TEST_F(LfShow, EpipolarLineHasTheRequestedOffset) {
  const std::string row = "epi --row 1 --focus-distance 2.2 --stripe 4";
  const Image middle = picture(row), below = picture(row + " --across 0.1"), outside = picture(row + " --across 5");
  EXPECT_NE(middle.data(), below.data());
  EXPECT_GT(count(below, {0, 0, 96, 16}, 60), 96 * 8);
  EXPECT_EQ(count(outside, {0, 0, 96, 16}, 1), 0) << "no camera sees this region";
}

TEST_F(LfShow, ScaleOfDifferencesHasTheRequestedEnd) {
  const auto bright = [&](const std::string& full) {
    test::expect_outcome(run("difference --rig rig.json --scene --out scale.png" + full), 0);
    const Image image = load_image(path("scale.png"));
    int sum = 0;
    for (int y = 0; y < 72; y++)
      for (int x = 0; x < 96; x++) sum += image.pixel(x, y) == nullptr ? 0 : light(image, x, y);
    return sum;
  };
  const int coarse = bright(" --full-scale 255"), usual = bright(""), fine = bright(" --full-scale 8");
  EXPECT_LT(coarse, usual);
  EXPECT_LT(usual, fine);
}

TEST_F(LfShow, FilmsHaveTheRequestedRate) {
  save_path(0);
  for (const std::string command :
       {"contributions --views v.json --focus plane", "coverage --views v.json --focus plane",
        "sweep --near 1 --far 5 --planes 3", "difference --views v.json --focus plane --scene"}) {
    const Outcome outcome = run(command + " --rig rig.json --framerate 5 --out film.mkv");
    ASSERT_EQ(outcome.status, 0) << command << ": " << outcome.output;
    const std::vector<GstClockTime> times = test::read_recorded(path("film.mkv")).times;
    ASSERT_EQ(times.size(), 3u) << command;
    EXPECT_EQ(times[2] - times[0], 400 * GST_MSECOND) << command;
  }
}

}  // namespace
}  // namespace lf
