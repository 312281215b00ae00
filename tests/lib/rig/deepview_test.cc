// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"
#include "support/expect_error.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

// The camera of the README of the DeepView Video dataset, and a second one.
constexpr char kFile[] = R"([{"name": "camera_0001",
 "position": [0.003311238794086777, 0.000126384684934784, 0.42421246053630285],
 "orientation": [-0.03295944563072383, 0.02964606619481096, -0.03337751007195316],
 "focal_length": 1111.3638715594666, "pixel_aspect_ratio": 1.0,
 "principal_point": [1284.7296468363463, 925.4651609728676], "height": 1920.0, "width": 2560.0,
 "radial_distortion": [0.0970525284520715, -0.01708587111009977, 0.0], "projection_type": "fisheye"},
 {"name": "camera_0002", "position": [0.1, 0, 0.4], "orientation": [0, 0, 0], "focal_length": 1100,
 "pixel_aspect_ratio": 1, "principal_point": [1280, 960], "height": 1920, "width": 2560,
 "radial_distortion": [0, 0, 0], "projection_type": "fisheye"}])";

std::string replaced(const std::string& from, const std::string& to) {
  std::string text = kFile;
  const size_t at = text.find(from);
  EXPECT_NE(at, text.npos) << from;
  return text.replace(at, from.size(), to);
}

class DeepViewTest : public testing::Test {
 protected:
  RigImport import(const std::string& text) const { return import_deepview(dir_.write("models.json", text)); }

  const TempDir dir_;
};

// The README projects this point with this camera to these pixels.
TEST_F(DeepViewTest, ProjectsLikeTheReadme) {
  const RigImport result = import(kFile);
  ASSERT_EQ(result.rig.cameras.size(), 2u);
  EXPECT_FALSE(result.has_unit);
  const Camera& camera = result.rig.cameras[0];
  EXPECT_EQ(camera.name, "camera_0001");
  EXPECT_EQ(camera.width, 2560);
  const auto pixel = camera.lens.project(camera.pose.camera_from_world({0.5, 0.5, 10}));
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->x, 1377.85525, 1e-4);
  EXPECT_NEAR(pixel->y, 1017.61440, 1e-4);
}

TEST_F(DeepViewTest, FilmsBesideTheFileAreSources) {
  dir_.write("camera_0002.mp4", "");
  const RigImport result = import(kFile);
  EXPECT_EQ(result.rig.cameras[0].source, "");
  EXPECT_THAT(result.rig.cameras[1].source, testing::EndsWith("camera_0002.mp4"));
  EXPECT_THAT(result.notes, Contains(mentions("1 of 2", "no film")));
  dir_.write("camera_0001.mp4", "");
  EXPECT_THAT(import(kFile).notes, testing::Not(Contains(mentions("no film"))));
}

TEST_F(DeepViewTest, DamagedFilesAreRefused) {
  const InvalidText cases[] = {
      {"", {"JSON"}},
      {"[]", {"models.json", "1 to 65535"}},
      {"{}", {"models.json", "array"}},
      {replaced("camera_0002", "camera_0001"), {"[1].name", "two cameras"}},
      {replaced("\"fisheye\"", "\"perspective\""), {"[0].projection_type", "perspective"}},
      {replaced("\"pixel_aspect_ratio\": 1.0", "\"pixel_aspect_ratio\": 1.1"), {"[0].pixel_aspect_ratio", "1.1"}},
      {replaced("-0.01708587111009977, 0.0]", "-0.01708587111009977, 0.1]"), {"[0].radial_distortion", "third", "0.1"}},
      {replaced("-0.01708587111009977, 0.0]", "-0.01708587111009977]"), {"[0].radial_distortion", "3"}},
      {replaced("\"focal_length\": 1100", "\"focal_length\": -1"), {"[1].focal_length", "positive"}},
      {replaced("\"orientation\": [0, 0, 0],", ""), {"[1]", "orientation", "missing"}},
      {replaced("\"position\": [0.1, 0, 0.4]", "\"position\": [0.1, 0]"), {"[1].position", "3"}},
      {replaced("\"width\": 2560,", "\"width\": 0,"), {"[1].width", "16384"}},
  };
  for (const auto& [text, facts] : cases) EXPECT_THAT(text_of_error([&] { import(text); }), Mentions(facts)) << text;
}

}  // namespace
}  // namespace lf
