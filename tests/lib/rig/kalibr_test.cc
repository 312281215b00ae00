// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"

#include <gtest/gtest.h>

#include "support/expect_error.h"
#include "support/mixed_rig.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

// As Kalibr writes it: sequences as far to the left as their keys.
constexpr char kStereo[] = R"(cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, 0.00019, 1.76e-05]
  distortion_model: radtan
  intrinsics: [458.654, 457.296, 367.215, 248.375]
  resolution: [752, 480]
  rostopic: /left/image_raw
cam1:
  T_cn_cnm1:
  - [0.0, 0.0, -1.0, 0.5]
  - [0.0, 1.0, 0.0, 0.0]
  - [1.0, 0.0, 0.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_coeffs: []
  distortion_model: none
  intrinsics: [400, 400, 320, 240]
  resolution: [752, 480]
)";

TEST(Kalibr, ReadsAStereoPair) {
  const TempDir dir;
  const Rig rig = import_kalibr(dir.write("x.yaml", kStereo)).rig;
  ASSERT_EQ(rig.cameras.size(), 2u);
  EXPECT_EQ(rig.cameras[0].lens,
            Lens(LensModel::kOpenCv, {458.654, 457.296, 367.215, 248.375, -0.28, 0.07, 0.00019, 1.76e-05}));
  EXPECT_EQ(rig.cameras[0].name, "left");
  EXPECT_EQ(rig.cameras[0].pose, Pose());
  EXPECT_EQ(rig.cameras[1].lens, Lens::pinhole(400, 320, 240));
  EXPECT_EQ(rig.cameras[1].name, "cam1");
  // R c + t = 0: x_1 = -z_0 + 0.5, z_1 = x_0.
  EXPECT_LT(glm::length(rig.cameras[1].pose.position - Vec3(0, 0, 0.5)), 1e-15);
  EXPECT_LT(glm::length(rig.cameras[1].pose.forward() - Vec3(1, 0, 0)), 1e-15);
}

TEST(Kalibr, RoundTripsEveryModelWithin1e9Pixels) {
  const TempDir dir;
  const Rig rig = mixed_rig();
  const RigExport result = export_kalibr(rig, dir / "x.yaml");
  EXPECT_LE(result.max_error, 1e-9);
  EXPECT_EQ(result.notes.size(), 2u) << "ids and images";
  const Rig back = import_kalibr(dir / "x.yaml").rig;
  for (const double distance : {0.5, 3.0, 100.0}) EXPECT_LE(max_reprojection_error(rig, back, distance), 1e-9);
  EXPECT_EQ(back.cameras[3].name, "cam_3");
}

TEST(Kalibr, WhatWeLackIsRefusedByPlace) {
  const TempDir dir;
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = kStereo;
    text.replace(text.find(from), from.size(), to);
    dir.write("x.yaml", text);
    return text_of_error([&] { import_kalibr(dir / "x.yaml"); });
  };
  const std::string file = dir / "x.yaml";
  EXPECT_NE(with("radtan", "equidistant").find(file + ": cam0.distortion_model: a rig cannot hold"), std::string::npos);
  EXPECT_NE(with("pinhole", "omni").find(file + ": cam0.camera_model: a rig cannot hold"), std::string::npos);
  EXPECT_NE(with("radtan", "rational_polynomial").find("cam0.distortion_model: a rig cannot hold"), std::string::npos);
  EXPECT_NE(
      with("resolution: [752, 480]\n  rostopic", "line_delay: 2e-5\n  rostopic").find("cam0.line_delay: is 2e-05"),
      std::string::npos);
  EXPECT_EQ(with("[458.654, ", "["), file + ": cam0.intrinsics: must be [fx, fy, cx, cy]");
  EXPECT_EQ(with("- [0.0, 1.0,", "- [0.0, 9.0,"),
            file + ": cam1.T_cn_cnm1: must be a rotation (orthonormal, right-handed)");
  EXPECT_NE(with("T_cn_cnm1", "T"), "no lf::Error was thrown");
  EXPECT_NE(with("cam0", "cam7").find("cam0"), std::string::npos);
}

// A camera's T_cam_imu, `x` metres to the left of the IMU.
std::string at_imu(const char* key, double x) {
  return std::string("  ") + key + ": [[1, 0, 0, " + std::to_string(x) +
         "], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n";
}

std::string plain_camera(int number) {
  return "cam" + std::to_string(number) +
         ":\n  camera_model: pinhole\n  intrinsics: [400, 400, 320, 240]\n  distortion_model: none\n"
         "  resolution: [640.0, 480]\n";
}

TEST(Kalibr, TimeShiftsBecomeTimeOffsets) {
  const TempDir dir;
  const std::string text = plain_camera(0) + "  timeshift_cam_imu: 0.0019\n" + plain_camera(1) +
                           at_imu("T_cn_cnm1", -0.1) + "  timeshift_cam_imu: -0.025\n";
  const Rig rig = import_kalibr(dir.write("x.yaml", text)).rig;
  EXPECT_EQ(rig.cameras.at(0).time_offset, 0.0019);
  EXPECT_EQ(rig.cameras.at(1).time_offset, -0.025);
  EXPECT_EQ(rig.cameras.at(1).width, 640);
  EXPECT_TRUE(export_kalibr(rig, dir / "y.yaml").notes.empty()) << "they are written, too";
  EXPECT_EQ(import_kalibr(dir / "y.yaml").rig.cameras.at(1).time_offset, -0.025);
}

TEST(Kalibr, CamerasAfterAGapAreKeptOrRefused) {
  const TempDir dir;
  const std::string two = plain_camera(0) + at_imu("T_cam_imu", 0) + plain_camera(1) + at_imu("T_cn_cnm1", -0.1);
  const Rig rig =
      import_kalibr(dir.write("x.yaml", two + plain_camera(10) + at_imu("T_cn_cnm1", -0.1) + at_imu("T_cam_imu", -0.3) +
                                            plain_camera(12) + at_imu("T_imu_cam", 0.5)))
          .rig;
  ASSERT_EQ(rig.cameras.size(), 4u);
  EXPECT_EQ(rig.cameras[2].id, 10u);
  EXPECT_EQ(rig.cameras[2].name, "cam10") << "by number, not by letter";
  EXPECT_NEAR(rig.cameras[2].pose.position.x, 0.3, 1e-12);
  EXPECT_NEAR(rig.cameras[3].pose.position.x, 0.5, 1e-12);
  dir.write("x.yaml", two + plain_camera(3) + at_imu("T_cn_cnm1", -0.1));
  EXPECT_ERROR(import_kalibr(dir / "x.yaml"), "cam3.T_cn_cnm1: is relative to cam2, which the file does not have");
  dir.write("x.yaml", two + plain_camera(3));
  EXPECT_ERROR(import_kalibr(dir / "x.yaml"), "cam3: key \"T_cn_cnm1\" is missing");
  dir.write("x.yaml", two + plain_camera(2) + "cam02:\n  x: 1\n");
  EXPECT_ERROR(import_kalibr(dir / "x.yaml"), "cam02 and cam2 have the same number");
}

TEST(Kalibr, ListsWhatItDidNotRead) {
  const TempDir dir;
  const RigImport result = import_kalibr(dir.write("x.yaml", plain_camera(0) + "  exposure: 3\nimu0:\n  rate: 200\n"));
  EXPECT_EQ(result.notes, std::vector<std::string>{"keys that were not read: exposure, imu0"});
}

}  // namespace
}  // namespace lf
