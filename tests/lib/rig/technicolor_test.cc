// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/image.h"
#include "rig/exchange.h"
#include "support/expect_error.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

constexpr char kTitles[] = "f cu cv ar sk qw qx qy qz tx ty tz\n";
constexpr int kWidth = 64, kHeight = 34;

// Camera 1 is turned about its y axis by 90 degrees.
const std::string kSecond = "50.5 32.25 17.5 0.99 0.01 0.7071068 0 0.7071068 0 0.1 0.2 1.5\n";

class TechnicolorTest : public testing::Test {
 protected:
  void write(const std::string& lines, const std::vector<std::string>& pictures) const {
    dir_.write("cameras_parameters.txt", kTitles + lines);
    for (const std::string& name : pictures)
      save_image(Image(PixelFamily::kRgb, kWidth, kHeight), dir_.write(name, ""));
  }
  // 16 cameras in a grid, 10 cm apart. camera_from_world has the negative position.
  static std::string grid(double pitch = 0.1) {
    std::string lines;
    for (int i = 0; i < 16; i++)
      lines += format_text("50 32 17 1 0 1 0 0 0 %g %g 0\n", -pitch * (i % 4), -pitch * (i / 4));
    return lines;
  }
  static std::vector<std::string> pictures(int cameras, const std::vector<int>& frames) {
    std::vector<std::string> names;
    for (const int frame : frames)
      for (int i = 0; i < cameras; i++) names.push_back(format_text("Painter_undist_%05d_%02d.png", frame, i));
    return names;
  }

  const TempDir dir_;
};

// The formulas of HyperReel's datasets/technicolor.py: K = [f sk cu; 0 ar f cv; 0 0 1], camera from world = [R(q) t].
TEST_F(TechnicolorTest, ProjectsLikeHyperReel) {
  write("50 32 17 1 0 1 0 0 0 0 0 0\n" + kSecond, pictures(2, {1}));
  const RigImport result = import_technicolor(dir_.path());
  ASSERT_EQ(result.rig.cameras.size(), 2u);
  EXPECT_FALSE(result.has_unit);
  EXPECT_THAT(result.notes, Contains(mentions("skew", "0.0035 px")));
  const Camera& camera = result.rig.cameras[1];
  EXPECT_EQ(camera.width, kWidth);
  const Vec3 world(-2, 0.3, 0.4), x(world.z + 0.1, world.y + 0.2, -world.x + 1.5);  // R maps z to x, and x to -z
  const auto pixel = camera.lens.project(camera.pose.camera_from_world(world));
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->x, 50.5 * x.x / x.z + 32.25 - 0.5, 1e-4);
  EXPECT_NEAR(pixel->y, 0.99 * 50.5 * x.y / x.z + 17.5 - 0.5, 1e-4);
}

TEST_F(TechnicolorTest, FilmsAreSequences) {
  for (const char* folder : {"", "images/"}) {
    const TempDir dir;
    dir.write("cameras_parameters.txt", kTitles + grid());
    for (const std::string& name : pictures(16, {1, 2}))
      save_image(Image(PixelFamily::kRgb, kWidth, kHeight), dir.write(folder + name, ""));
    const RigImport result = import_technicolor(dir.path());
    EXPECT_TRUE(result.notes.empty());
    EXPECT_EQ(result.rig.topology.type, Topology::Type::kGrid);
    EXPECT_EQ(result.rig.topology.columns, 4);
    EXPECT_LT(glm::distance(result.rig.cameras[7].pose.position, Vec3(0.3, 0.1, 0)), 1e-12);
    EXPECT_THAT(result.rig.cameras[7].source, testing::EndsWith(std::string(folder) + "Painter_undist_%05d_07.png"));
    EXPECT_EQ(result.rig.cameras[7].image, "");
  }
}

TEST_F(TechnicolorTest, FramesOfTheMiddleGiveAStill) {
  write(grid(), pictures(16, {257, 258}));
  const RigImport result = import_technicolor(dir_.path());
  EXPECT_THAT(result.rig.cameras[3].image, testing::EndsWith("Painter_undist_00257_03.png"));
  EXPECT_THAT(result.notes, Contains(mentions("only the first picture", "0, 1, 2")));
}

TEST_F(TechnicolorTest, OtherArraysAreIrregular) {
  write("50 32 17 1 0 1 0 0 0 0 0 0\n\n50 32 17 1 0 1 0 0 0 -1 0 0\n50 32 17 1 0 1 0 0 0 0 -1 0\n", pictures(3, {1}));
  EXPECT_EQ(import_technicolor(dir_.path()).rig.topology.type, Topology::Type::kDelaunay);
  std::string same;  // 16 cameras that are not a grid of 4x4
  for (int i = 0; i < 16; i++) same += format_text("50 32 17 1 0 1 0 0 0 %d %d 0\n", i % 8, i / 8);
  write(same, pictures(16, {1}));
  EXPECT_EQ(import_technicolor(dir_.path()).rig.topology.type, Topology::Type::kDelaunay);
}

TEST_F(TechnicolorTest, DamagedFilesAreRefused) {
  const std::string good = "50 32 17 1 0 1 0 0 0 0 0 0\n";
  const InvalidText cases[] = {
      {"", {"cameras_parameters.txt", "no cameras"}},
      {good, {"1 cameras", "pictures of camera 1"}},
      {good + good + good, {"line 4", "camera 2", "SCENE_undist_00001_02.png"}},
      {good + "50 32 17\n", {"line 3", "3 numbers", "12"}},
      {good + "50 32 17 1 0 0.1 -0.2 1 0 0 0 0 0 0\n", {"line 3", "distorted", "d1"}},
      {good + "50 32 x 1 0 1 0 0 0 0 0 0\n", {"line 3", "\"x\"", "number"}},
      {good + "50 32 17 1 0 1 0 0 0 0 nan 0\n", {"line 3", "nan", "finite"}},
      {good + "-50 32 17 1 0 1 0 0 0 0 0 0\n", {"line 3", "focal length", "positive"}},
      {good + "50 32 17 1 9 1 0 0 0 0 0 0\n", {"line 3", "skew", "3.06 px"}},
      {good + "50 32 17 1 0 1 1 0 0 0 0 0\n", {"line 3", "quaternion", "norm"}},
  };
  for (const auto& [text, facts] : cases) {
    write(text, pictures(2, {1}));
    EXPECT_THAT(text_of_error([&] { import_technicolor(dir_.path()); }), Mentions(facts)) << text;
  }
  write(good + good, {"Birthday_undist_00001_01.png"});
  EXPECT_ERROR(import_technicolor(dir_.path()), "same frame and camera", "Birthday", "Painter");
}

}  // namespace
}  // namespace lf
