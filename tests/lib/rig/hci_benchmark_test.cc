// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/image.h"
#include "rig/epipolar_check.h"
#include "rig/exchange.h"
#include "rig/rig_json.h"
#include "support/expect_error.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 40, kHeight = 30, kColumns = 3, kRows = 2;

// The scene "cotton" of the benchmark, with fewer and smaller images.
constexpr double kFocal = 100, kSensor = 35, kBaseline = 25, kFocusDistance = 4.25;
const Vec3 kMiddle(-2.455400228500366, -3.297091245651245, 2.5353269577026367);
const Vec3 kAngles(1.3232444524765015, -4.2063913241463524e-08, -0.6149072647094727);
constexpr char kParameters[] = R"([intrinsics]
focal_length_mm = 100.0
image_resolution_x_px = 40
image_resolution_y_px = 30
sensor_size_mm = 35.0
fstop = 100.0

[extrinsics]
num_cams_x = 3
num_cams_y = 2
baseline_mm = 25.0
focus_distance_m = 4.25
center_cam_x_m = -2.455400228500366
center_cam_y_m = -3.297091245651245
center_cam_z_m = 2.5353269577026367
center_cam_rx_rad = 1.3232444524765015
center_cam_ry_rad = -4.2063913241463524e-08
center_cam_rz_rad = -0.6149072647094727
offset = 0.6722689075630252

[meta]
scene = cotton
authors = Katrin Honauer, Ole Johannsen, Daniel Kondermann, Bastian Goldluecke
cycles_seed = 310298717
disp_min = -0.1
disp_max = 0.2
depth_map_scale = 10.0

)";

// Returns where a point of Blender's world is in the image of a camera, as rendered by the benchmark's add-on
// lightfield_simulator.py: Blender shifts the image by shift_x and shift_y, in units of the longer side.
Vec2 blender_pixel(const Vec3& world, int row, int column) {
  const double x_pos = kBaseline / 1000 * (column - (kColumns - 1) / 2.0);
  const double y_pos = kBaseline / 1000 * ((kRows - 1) / 2.0 - row);
  const double shift_x = -x_pos * kFocal / kSensor / kFocusDistance;
  const double shift_y = -y_pos * kFocal / kSensor / kFocusDistance;
  const auto turned = [](const Vec3& v, int axis, double angle) {  // right-handed, about an axis of the world
    const int i = (axis + 1) % 3, j = (axis + 2) % 3;
    Vec3 result = v;
    result[i] = std::cos(angle) * v[i] - std::sin(angle) * v[j];
    result[j] = std::sin(angle) * v[i] + std::cos(angle) * v[j];
    return result;
  };
  Vec3 local = world - kMiddle;
  for (const int axis : {2, 1, 0}) local = turned(local, axis, -kAngles[axis]);
  local -= Vec3(x_pos, y_pos, 0);
  const double scale = std::max(kWidth, kHeight);
  const double right = kFocal / kSensor * local.x / -local.z - shift_x;
  const double up = kFocal / kSensor * local.y / -local.z - shift_y;
  return {kWidth / 2.0 + scale * right - 0.5, kHeight / 2.0 - scale * up - 0.5};
}

class HciTest : public testing::Test {
 protected:
  HciTest() {
    for (int i = 0; i < kRows * kColumns; i++)
      save_image(Image(PixelFamily::kRgb, kWidth, kHeight), dir_.write("input_Cam00" + std::to_string(i) + ".png", ""));
    dir_.write("parameters.cfg", kParameters);
  }
  void replace(const std::string& line, const std::string& by) const {
    std::string text = kParameters;
    const size_t at = text.find("\n" + line);
    ASSERT_NE(at, text.npos) << line;
    const size_t end = text.find('\n', at + 1);
    dir_.write("parameters.cfg", text.replace(at + 1, end - at - 1, by));
  }

  const TempDir dir_;
};

TEST_F(HciTest, ProjectsLikeBlender) {
  const RigImport import = import_hci(dir_.path());
  const Rig& rig = import.rig;
  ASSERT_EQ(rig.cameras.size(), 6u);
  EXPECT_EQ(rig.topology.rows, kRows);
  EXPECT_EQ(rig.topology.columns, kColumns);
  EXPECT_EQ(rig.cameras[4].name, "input_Cam004");
  EXPECT_EQ(fs::weakly_canonical(rig.cameras[4].image), dir_ / "input_Cam004.png");
  EXPECT_NEAR(rig.cameras[0].lens.fx(), 100 / 35.0 * 40, 1e-12);
  for (const Vec3& world : {Vec3(-0.3, -0.7, 1.7), Vec3(0.4, 0.6, 1.2), Vec3(-1.2, 0.3, 2.4)})
    for (int i = 0; i < 6; i++) {
      const Camera& camera = rig.cameras[i];
      const auto pixel = camera.lens.project(camera.pose.camera_from_world({world.x, -world.z, world.y}));
      ASSERT_TRUE(pixel);
      EXPECT_LT(glm::length(*pixel - blender_pixel(world, i / kColumns, i % kColumns)), 1e-9) << "camera " << i;
    }
}

TEST_F(HciTest, TheFocusDistanceHasNoDisparity) {
  const Rig rig = import_hci(dir_.path()).rig;
  const auto disparity = [&](double depth) {
    std::vector<Vec2> pixels;
    for (const int i : {0, 1}) {
      const Camera& camera = rig.cameras[i];
      const Vec3 world = rig.cameras[0].pose.world_from_camera({0.1, 0.2, depth});
      pixels.push_back(camera.lens.project(camera.pose.camera_from_world(world)).value());
    }
    EXPECT_NEAR(pixels[0].y, pixels[1].y, 1e-9);
    return pixels[0].x - pixels[1].x;
  };
  EXPECT_NEAR(disparity(kFocusDistance), 0, 1e-9);
  // depth2disp() of the benchmark's evaluation toolkit.
  const double depth = 3.5, f = kBaseline / 1000 * kFocal * kWidth;
  EXPECT_NEAR(disparity(depth), (f * kFocusDistance / depth - f) / kFocusDistance / kSensor, 1e-9);
  EXPECT_EQ(depth_note(import_hci(dir_.path())), "the scene is from 3.276 to 4.993 m away (focus-near, focus-far)");
}

TEST_F(HciTest, RoundTripsWithin1e9Pixels) {
  for (const char* focus : {"focus_distance_m = 4.25", "focus_distance_m = 0"}) {
    replace("focus_distance_m", focus);
    const Rig rig = import_hci(dir_.path()).rig;
    const RigExport result = export_hci(rig, dir_ / "out");
    EXPECT_LE(result.max_error, 1e-9);
    EXPECT_THAT(result.notes, ElementsAre(mentions("names")));
    const Rig back = import_hci(dir_ / "out").rig;
    EXPECT_LE(max_reprojection_error(rig, back, 1), 1e-9);
    EXPECT_EQ(back.topology.columns, kColumns);
  }
}

TEST_F(HciTest, RefusesRigsThatTheFormatCannotHold) {
  const Rig rig = import_hci(dir_.path()).rig;
  Rig other = rig;
  other.cameras[4].pose.position.y += 0.001;
  EXPECT_ERROR(export_hci(other, dir_ / "out"), "equal distances", "px");
  other = rig;
  other.cameras[1].image = "a.jpg";
  EXPECT_ERROR(export_hci(other, dir_ / "out"), "camera 1", "PNG");
  other = rig;
  other.topology.type = Topology::Type::kDelaunay;
  EXPECT_ERROR(export_hci(other, dir_ / "out"), "grid");
  EXPECT_FALSE(fs::exists(dir_ / "out"));
}

TEST_F(HciTest, AFocusDistanceOf0IsInfinity) {
  replace("focus_distance_m", "focus_distance_m = 0");
  const RigImport import = import_hci(dir_.path());
  for (const Camera& camera : import.rig.cameras) EXPECT_EQ(camera.principal_point(), Vec2(19.5, 14.5));
  EXPECT_EQ(depth_note(import), "the scene begins 14.29 m away (focus-near)");
}

TEST_F(HciTest, AnArrayWithoutAPlaceIsAtTheOrigin) {
  std::string text = kParameters;
  text.erase(text.find("center_cam_x_m"), text.find("offset") - text.find("center_cam_x_m"));
  dir_.write("parameters.cfg", text);
  const RigImport import = import_hci(dir_.path());
  EXPECT_THAT(import.notes, Contains(mentions("center_cam_x_m", "origin")));
  EXPECT_EQ(import.rig.cameras[5].pose.position, Vec3(0.025, 0.0125, 0));
  EXPECT_EQ(import.rig.cameras[5].pose.orientation, Quat(1, 0, 0, 0));
}

TEST_F(HciTest, DamagedFilesAreRefused) {
  const struct {
    const char *line, *by;
    std::vector<std::string> facts;
  } cases[] = {
      {"[extrinsics]", "[other]", {"extrinsics", "missing"}},
      {"[extrinsics]", "[intrinsics]", {"line 8", "intrinsics", "twice"}},
      {"[intrinsics]", "fstop", {"line 1", "[section]"}},
      {"focal_length_mm", "", {"intrinsics", "focal_length_mm", "missing"}},
      {"focal_length_mm", "focal_length_mm = 100 mm", {"intrinsics.focal_length_mm", "number"}},
      {"focal_length_mm", "focal_length_mm = nan", {"intrinsics.focal_length_mm", "number"}},
      {"sensor_size_mm", "sensor_size_mm = 0", {"intrinsics.sensor_size_mm", "positive"}},
      {"baseline_mm", "baseline_mm = -1", {"extrinsics.baseline_mm", "positive", "-1"}},
      {"baseline_mm", "num_cams_x = 2", {"line 11", "num_cams_x", "twice"}},
      {"num_cams_x", "num_cams_x = 70000", {"extrinsics.num_cams_x", "65535"}},
      {"num_cams_x", "num_cams_x = 4", {"input_Cam006.png"}},
      {"focus_distance_m", "focus_distance_m = -1", {"extrinsics.focus_distance_m", "negative"}},
      {"focus_distance_m", "focus_distance_m = 1e-9", {"extrinsics.focus_distance_m", "shifts"}},
      {"center_cam_ry_rad", "", {"extrinsics", "center_cam_ry_rad", "missing"}},
      {"image_resolution_y_px", "image_resolution_y_px = 40", {"input_Cam000.png", "40x30", "40x40"}},
  };
  for (const auto& [line, by, facts] : cases) {
    if (std::string(line) == "[intrinsics]")
      dir_.write("parameters.cfg", by);
    else
      replace(line, by);
    const std::string error = text_of_error([&] { import_hci(dir_.path()); });
    EXPECT_THAT(error, HasSubstr(dir_.path()));
    EXPECT_THAT(error, Mentions(facts));
  }
  const TempDir empty;
  EXPECT_ERROR(import_hci(empty.path()), "parameters.cfg");
}

// Every second image of the scene "antinous". The rig file beside the images has f = 1462.9 instead of 1462.857.
TEST(Hci, ImportsARealScene) {
  const fs::path data = fs::path(LF_SOURCE_ROOT) / "../shared/data/antinous";
  if (!fs::exists(data)) GTEST_SKIP() << "needs ../shared/data";
  const Rig antinous = load_rig(data / "rig.json");
  const TempDir dir;
  for (size_t i = 0; i < 25; i++)
    fs::create_symlink(fs::absolute(antinous.resolve(antinous.cameras[i].image)),
                       dir / ("input_Cam0" + std::string(i < 10 ? "0" : "") + std::to_string(i) + ".png"));
  dir.write("parameters.cfg",
            "[intrinsics]\nfocal_length_mm = 100\nsensor_size_mm = 35\nimage_resolution_x_px = 512\n"
            "image_resolution_y_px = 512\n[extrinsics]\nnum_cams_x = 5\nnum_cams_y = 5\nbaseline_mm = 100\n"
            "focus_distance_m = 6\n");
  const Rig rig = import_hci(dir.path()).rig;
  EXPECT_LT(max_reprojection_error(antinous, rig, 6), 0.02);
  Image image;
  const auto load = [&](CameraIndex i) -> const Image& {
    return image = load_image(rig.resolve(rig.cameras[i].image));
  };
  EXPECT_THAT(describe(check_epipolar_geometry(rig, load)), testing::IsEmpty());
}

}  // namespace
}  // namespace lf
