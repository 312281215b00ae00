// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"
#include "support/expect_error.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

// In the form of the files of RVS's VSRS_to_JSON.m.
constexpr char kFile[] = R"({
  "Version": "2.0",
  "Content_name": "ULB_Unicorn",
  "BoundingBox_center": [0, 0, 0],
  "Fps": 30,
  "Frames_number": 1,
  "Informative": {"Converted_by": "VSRS_to_JSON.m", "Original_units": "mm", "New_units": "m"},
  "cameras": [
    {"Name": "v0", "Position": [0.5, 0.25, -0.125], "Rotation": [20, -10, 5], "Depthmap": 1, "Background": 0,
     "Depth_range": [0.5, 2], "Resolution": [1920, 1080], "Projection": "Perspective", "Focal": [1546.74, 1547.5],
     "Principle_point": [960, 540], "BitDepthColor": 10, "BitDepthDepth": 16, "ColorSpace": "YUV420",
     "DepthColorSpace": "YUV420"},
    {"Name": "v1", "Position": [0, 0, 0], "Rotation": [0, 0, 0], "Depthmap": 1, "Background": 0,
     "Depth_range": [0.75, 4], "Resolution": [1920, 1080], "Projection": "Perspective", "Focal": [1500, 1500],
     "Principle_point": [961.5, 540.5], "BitDepthColor": 10, "BitDepthDepth": 16, "ColorSpace": "YUV420",
     "DepthColorSpace": "YUV420"},
    {"Name": "viewport", "Position": [0, 0, 0], "Rotation": [0, 0, 0], "Depthmap": 0, "Background": 0,
     "Depth_range": [0.5, 2], "Resolution": [2048, 2048], "Projection": "Perspective", "Focal": [1024, 1024],
     "Principle_point": [1024, 1024], "BitDepthColor": 10, "BitDepthDepth": 10, "ColorSpace": "YUV420",
     "DepthColorSpace": "YUV420"}
  ]
}
)";

std::string replaced(const std::string& from, const std::string& to) {
  std::string text = kFile;
  const size_t at = text.find(from);
  EXPECT_NE(at, text.npos) << from;
  return text.replace(at, from.size(), to);
}

class MivTest : public testing::Test {
 protected:
  RigImport import(const std::string& text) const { return import_miv(dir_.write("cameras.json", text)); }

  const TempDir dir_;
};

// Projects like RVS: EulerAnglesToRotationMatrix() of its Parameters.cpp, and the inverse of its
// PerspectiveUnprojector. The centre of the top-left pixel is (0.5, 0.5).
Vec2 miv_pixel(const Vec3& world, const Vec3& position, const Vec3& degrees, const Vec2& focal, const Vec2& centre) {
  const double yaw = degrees.x * M_PI / 180, pitch = degrees.y * M_PI / 180, roll = degrees.z * M_PI / 180;
  const Mat3 z(std::cos(yaw), std::sin(yaw), 0, -std::sin(yaw), std::cos(yaw), 0, 0, 0, 1);
  const Mat3 y(std::cos(pitch), 0, -std::sin(pitch), 0, 1, 0, std::sin(pitch), 0, std::cos(pitch));
  const Mat3 x(1, 0, 0, 0, std::cos(roll), std::sin(roll), 0, -std::sin(roll), std::cos(roll));
  const Vec3 p = glm::transpose(z * y * x) * (world - position);  // forward, left, up
  return {-focal.x * p.y / p.x + centre.x, -focal.y * p.z / p.x + centre.y};
}

TEST_F(MivTest, ProjectsLikeRvs) {
  const RigImport result = import(kFile);
  ASSERT_EQ(result.rig.cameras.size(), 2u);
  EXPECT_THAT(result.notes, Contains(mentions("viewport")));
  EXPECT_EQ(depth_note(result), "the scene is from 0.5 to 4 m away (focus-near, focus-far)");
  const Camera &first = result.rig.cameras[0], &second = result.rig.cameras[1];
  EXPECT_EQ(first.name, "v0");
  EXPECT_EQ(second.id, 1u);
  EXPECT_EQ(second.pose, Pose());
  EXPECT_EQ(second.lens, Lens::pinhole(1500, 961, 540));
  for (const Vec3& world : {Vec3(2.5, 0.7, 0.1), Vec3(3, 1.5, 0.8), Vec3(9, 2, -1)}) {
    const auto pixel = first.lens.project(first.pose.camera_from_world({-world.y, -world.z, world.x}));
    ASSERT_TRUE(pixel);
    const Vec2 expected = miv_pixel(world, {0.5, 0.25, -0.125}, {20, -10, 5}, {1546.74, 1547.5}, {960, 540});
    EXPECT_LT(glm::length(*pixel + Vec2(0.5, 0.5) - expected), 1e-9);
  }
}

TEST_F(MivTest, ReadsOnlySourceCameras) {
  const RigImport result =
      import(replaced("\"cameras\"", "\"lengthsInMeters\": false, \"sourceCameraNames\": [\"v1\"], \"cameras\""));
  ASSERT_EQ(result.rig.cameras.size(), 1u);
  EXPECT_EQ(result.rig.cameras[0].name, "v1");
  EXPECT_THAT(result.notes, Contains(mentions("v0", "viewport", "left out")));
  EXPECT_EQ(depth_note(result), "the scene is from 0.75 to 4 units away (focus-near, focus-far)");
  EXPECT_ERROR(import(replaced("\"cameras\"", "\"sourceCameraNames\": [\"v7\"], \"cameras\"")), "cameras.json",
               "sourceCameraNames", "v7");
}

TEST_F(MivTest, AFarDepthOf1000IsInfinity) {
  EXPECT_EQ(depth_note(import(replaced("[0.75, 4]", "[0.75, 1000]"))), "the scene begins 0.5 m away (focus-near)");
}

TEST_F(MivTest, OtherProjectionsAreRefused) {
  for (const char* name : {"Equirectangular", "Orthographic"})
    EXPECT_ERROR(import(replaced("\"Perspective\"", "\"" + std::string(name) + "\"")), "cameras.json",
                 "cameras[0].Projection", name);
}

TEST_F(MivTest, DamagedFilesAreRefused) {
  const InvalidText cases[] = {
      {"", {"JSON"}},
      {"{\"cameras\": []}", {"cameras", "1 to 65535"}},
      {"{\"frames\": []}", {"cameras", "missing"}},
      {replaced("\"Name\": \"v1\"", "\"Name\": \"v0\""), {"cameras[1].Name", "two cameras"}},
      {replaced("\"Name\": \"v1\",", ""), {"cameras[1]", "Name", "missing"}},
      {replaced("[20, -10, 5]", "[20, -10]"), {"cameras[0].Rotation", "3"}},
      {replaced("[1546.74, 1547.5]", "[1546.74, 0]"), {"cameras[0].Focal", "positive"}},
      {replaced("[1546.74, 1547.5]", "1546.74"), {"cameras[0].Focal", "array"}},
      {replaced("[960, 540]", "[960, \"540\"]"), {"cameras[0].Principle_point[1]", "number"}},
      {replaced("[1920, 1080]", "[1920, 0]"), {"cameras[0].Resolution[1]", "16384"}},
      {replaced("[0.5, 2]", "[2, 0.5]"), {"cameras[0].Depth_range", "near"}},
      {std::string(kFile, 400), {"JSON"}},
  };
  for (const auto& [text, facts] : cases) {
    const std::string error = text_of_error([&] { import(text); });
    EXPECT_THAT(error, HasSubstr("cameras.json"));
    EXPECT_THAT(error, Mentions(facts));
  }
}

}  // namespace
}  // namespace lf
