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
  EXPECT_EQ(with("radtan", "equidistant"), file + ": cam0.distortion_model: no lens of ours equals \"equidistant\"");
  EXPECT_EQ(with("pinhole", "omni"), file + ": cam0.camera_model: no lens of ours equals \"omni\"");
  EXPECT_EQ(with("[458.654, ", "["), file + ": cam0.intrinsics: must be [fx, fy, cx, cy]");
  EXPECT_EQ(with("- [0.0, 1.0,", "- [0.0, 9.0,"),
            file + ": cam1.T_cn_cnm1: must be a rotation (orthonormal, right-handed)");
  EXPECT_NE(with("T_cn_cnm1", "T"), "no lf::Error was thrown");
  EXPECT_NE(with("cam0", "cam7").find("cam0"), std::string::npos);
}

}  // namespace
}  // namespace lf
