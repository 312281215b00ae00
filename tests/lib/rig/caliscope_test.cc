// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/json_value.h"
#include "rig/exchange.h"
#include "support/expect_error.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

// Camera 0 as written by Caliscope 0.5 (a rotation matrix), camera 10 as written since 0.7 (a Rodrigues vector). The
// numbers are from Caliscope's tests/sessions/4_cam_recording, without k3.
constexpr char kArray[] = R"([cameras.10]
cam_id = 10
size = [1280, 720]
rotation_count = -1
error = 0.469
matrix = [[703.9581082139392, 0.0, 626.0054656040467], [0.0, 706.235022552987, 348.8635696574537], [0.0, 0.0, 1.0]]
distortions = [0.19214795710153681, -0.256426138563638, 0.0028024971240443184, -0.005231509572999095, 0.0]
translation = [0.04, -0.02, 0.3]
rotation = [0.3, -0.7, 1.1]
exposure = -6
grid_count = 34
fisheye = false

# older
[cameras.0]
port =0
rotation_count = 0
error = 0.19
ignore = false
size = [1280, 720]
matrix = [
    [894.5288733178912, 0.0, 624.011791468827], # fx, 0, cx
    [0.0, 896.877811780321, 361.28189843593503],
    [0.0, 0.0, 1.0],
]
distortions = [0, 0, 0, 0]
translation = [-0.6425176710599999, 0.2628680995431283, 1.4515383168392715]
rotation = [[0.028454458274723926, -0.8200005191342249, 0.571655046705523], [-0.9915778577174362, -0.0954406312087065, -0.0875467760627629], [0.12634752031121108, -0.5643493904790591, -0.8158100695487417]]
verified_resolutions = [[640, 480], [1280, 720]]

[cameras.3]
size = [640, 480]
matrix = "null"
rotation = 'null'
translation = "null"
)";

std::string replaced(const std::string& from, const std::string& to) {
  std::string text = kArray;
  const size_t at = text.find(from);
  EXPECT_NE(at, text.npos) << from;
  return text.replace(at, from.size(), to);
}

class CaliscopeTest : public testing::Test {
 protected:
  RigImport import(const std::string& text, bool undistorted = false) const {
    return import_caliscope(dir_.write("camera_array.toml", text), undistorted);
  }

  const TempDir dir_;
};

TEST_F(CaliscopeTest, ProjectsLikeCaliscope) {
  const RigImport result = import(kArray);
  ASSERT_EQ(result.rig.cameras.size(), 2u);
  EXPECT_THAT(result.notes, Contains(mentions("without a pose", "3")));
  const Camera &first = result.rig.cameras[0], &second = result.rig.cameras[1];
  EXPECT_EQ(first.id, 0u);
  EXPECT_EQ(second.id, 10u);
  EXPECT_EQ(second.name, "cam_10");
  EXPECT_EQ(second.width, 1280);
  EXPECT_EQ(first.lens.model(), LensModel::kPinhole);

  // CameraData.normalized_projection_matrix: [R | t] maps from world to camera.
  const Vec3 world(0.5, 0.6, 0.2);
  const Vec3 x(
      0.028454458274723926 * world.x - 0.8200005191342249 * world.y + 0.571655046705523 * world.z - 0.64251767,
      -0.9915778577174362 * world.x - 0.0954406312087065 * world.y - 0.0875467760627629 * world.z + 0.2628681,
      0.12634752031121108 * world.x - 0.5643493904790591 * world.y - 0.8158100695487417 * world.z + 1.45153832);
  const auto pixel = first.lens.project(first.pose.camera_from_world(world));
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->x, 894.5288733178912 * x.x / x.z + 624.011791468827, 1e-4);
  EXPECT_NEAR(pixel->y, 896.877811780321 * x.y / x.z + 361.28189843593503, 1e-4);

  // cv2.Rodrigues() and cv2.projectPoints().
  const Vec3 r(0.3, -0.7, 1.1), axis = glm::normalize(r);
  const double angle = glm::length(r);
  const Vec3 y = world * std::cos(angle) + glm::cross(axis, world) * std::sin(angle) +
                 axis * glm::dot(axis, world) * (1 - std::cos(angle)) + Vec3(0.04, -0.02, 0.3);
  const double u = y.x / y.z, v = y.y / y.z, q = u * u + v * v;
  const double k1 = 0.19214795710153681, k2 = -0.256426138563638, p1 = 0.0028024971240443184,
               p2 = -0.005231509572999095;
  const double radial = 1 + k1 * q + k2 * q * q;
  const auto other = second.lens.project(second.pose.camera_from_world(world));
  ASSERT_TRUE(other);
  EXPECT_NEAR(other->x, 703.9581082139392 * (u * radial + 2 * p1 * u * v + p2 * (q + 2 * u * u)) + 626.0054656040467,
              1e-9);
  EXPECT_NEAR(other->y, 706.235022552987 * (v * radial + p1 * (q + 2 * v * v) + 2 * p2 * u * v) + 348.8635696574537,
              1e-9);
}

TEST_F(CaliscopeTest, CamerasThatAreNotUsedAreLeftOut) {
  std::string text = replaced("distortions = [0, 0, 0, 0]\n", "");
  text.replace(text.find("ignore = false"), 14, "ignore = true");
  const RigImport result = import(text);
  ASSERT_EQ(result.rig.cameras.size(), 1u);
  EXPECT_EQ(result.rig.cameras[0].id, 10u);
  EXPECT_THAT(result.notes, Contains(mentions("ignores", "0")));
}

TEST_F(CaliscopeTest, UndistortedVideosHavePinholes) {
  const std::string text = replaced("-0.005231509572999095, 0.0]", "-0.005231509572999095, 0.115]");
  EXPECT_EQ(import(text).rig.cameras[1].lens.distortion().k[2], 0.115);
  const Rig rig = import(text, true).rig;
  EXPECT_EQ(rig.cameras[1].lens,
            Lens(LensModel::kPinhole, {703.9581082139392, 706.235022552987, 626.0054656040467, 348.8635696574537}));
}

TEST_F(CaliscopeTest, ReadsFisheyeLenses) {
  std::string text = replaced("fisheye = false", "fisheye = true");
  const size_t place = text.find("distortions = ");
  const auto with = [&](const std::string& terms) {
    std::string other = text;
    return other.replace(place, other.find('\n', place) - place, terms);
  };
  const Rig rig = import(with("distortions = [0.01, -0.02, 0.003, -0.0004]")).rig;
  const auto fisheye =
      std::ranges::find(rig.cameras, LensModel::kOpenCvFisheye, [](const Camera& c) { return c.lens.model(); });
  ASSERT_NE(fisheye, rig.cameras.end());
  EXPECT_EQ(fisheye->lens.distortion().k, (std::array<double, 4>{0.01, -0.02, 0.003, -0.0004}));
  EXPECT_ERROR(import(with("distortions = [0.01, 0, 0, 0, 0.1]")), "distortions", "k4");
  EXPECT_ERROR(import(with("")), "camera_array.toml", "k1, k2, k3 and k4");
}

TEST_F(CaliscopeTest, DamagedFilesAreRefused) {
  const InvalidText cases[] = {
      {"", {"cameras", "missing"}},
      {"[cameras.left]\n", {"cameras", "left", "number"}},
      {"[cameras]\n1 = 5\n", {"cameras.1", "object"}},
      {"cam_id\n", {"line 1", "key = value"}},
      {"[cameras.0\nsize = [1, 2]", {"line 1", "[table]"}},
      {"[cameras.0]\n[cameras.0]\n", {"line 2", "twice"}},
      {"[cameras.0]\nsize = [1, 2\n\nmatrix = 3", {"line", "TOML"}},
      {"[cameras.0]\nsize = [1, 2] 3\n", {"line 2", "after the value"}},
      {"x = 3\n[x.0]\n", {"line 2", "x", "both a table and a value"}},
      {replaced("distortions = [0, 0, 0, 0]", "distortions = []"), {"cameras.0.distortions", "[k1, k2, p1, p2, k3]"}},
      {replaced("703.9581082139392, 0.0", "703.9581082139392, 0.1"), {"cameras.10.matrix", "skew"}},
      {replaced("703.9581082139392", "-703"), {"cameras.10.matrix", "positive"}},
      {replaced("size = [1280, 720]", "size = [1280]"), {"cameras.10.size", "2"}},
      {replaced("rotation = [0.3, -0.7, 1.1]", "rotation = [0.3, -0.7]"), {"cameras.10.rotation", "3"}},
      {replaced("translation = [0.04, -0.02, 0.3]", ""), {"cameras.10", "translation", "missing"}},
      {replaced("translation = [0.04, -0.02, 0.3]", "translation = [0.04, -0.02, inf]"),
       {"cameras.10.translation[2]", "number"}},
      {replaced("grid_count = 34", "grid_count = 34\ncam_id = 5"), {"line 12", "cam_id", "twice"}},
  };
  for (const auto& [text, facts] : cases) {
    const std::string error = text_of_error([&] { import(text); });
    EXPECT_THAT(error, HasSubstr("camera_array.toml"));
    EXPECT_THAT(error, Mentions(facts));
  }
  EXPECT_ERROR(import(replaced("0.571655046705523", "0.6")), "cameras.0.rotation", "orthonormal");
  EXPECT_ERROR(import("[cameras.0]\nsize = [4, 3]\n"), "cameras", "no camera", "extrinsics");
}

// Four webcams with undistorted videos. Their lenses have k3.
TEST(Caliscope, ImportsARealArray) {
  const std::filesystem::path data = std::filesystem::path(LF_SOURCE_ROOT) / "../shared/data/webcams";
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "needs ../shared/data";
  const std::string file = data / "camera_array.toml";
  for (const Camera& camera : import_caliscope(file).rig.cameras)
    EXPECT_EQ(camera.lens.model(), LensModel::kFullOpenCv);
  const Rig rig = import_caliscope(file, true).rig;
  ASSERT_EQ(rig.cameras.size(), 4u);
  // The board, around the origin of the world, is near the middle of all images.
  for (const Camera& camera : rig.cameras) {
    const auto pixel = camera.lens.project(camera.pose.camera_from_world({0, 0, 0}));
    ASSERT_TRUE(pixel);
    EXPECT_LT(glm::length(*pixel - Vec2(640, 360)), 400);
    EXPECT_GT(glm::length(camera.pose.position), 0.8);
  }
}

}  // namespace
}  // namespace lf
