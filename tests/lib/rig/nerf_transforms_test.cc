// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"

#include <cmath>

#include <gtest/gtest.h>

#include "image/image.h"
#include "support/expect_error.h"
#include "support/mixed_rig.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

constexpr char kIdentity[] = R"("transform_matrix": [[1, 0, 0, 7], [0, 1, 0, 8], [0, 0, 1, 9], [0, 0, 0, 1]])";

std::string one_frame(const std::string& top, const std::string& frame = "") {
  return "{" + top + R"("frames": [{"file_path": "./images/a.png", )" + frame + kIdentity + "}]}";
}

TEST(Nerf, ConventionsOfPixelsAndAxes) {
  const TempDir dir;
  dir.write("t.json", one_frame(R"("fl_x": 400, "fl_y": 410, "cx": 160, "cy": 120, "w": 320, "h": 240, )"));
  const Camera camera = import_nerf(dir / "t.json").rig.cameras.at(0);
  EXPECT_EQ(camera.lens, Lens(LensModel::kPinhole, {400, 410, 159.5, 119.5}));
  EXPECT_EQ(camera.pose.position, Vec3(7, 8, 9));
  EXPECT_LT(glm::length(camera.pose.forward() - Vec3(0, 0, -1)), 1e-15) << "NeRF looks along -z";
  EXPECT_LT(glm::length(camera.pose.down() - Vec3(0, -1, 0)), 1e-15) << "its y is up";
  EXPECT_LT(glm::length(camera.pose.right() - Vec3(1, 0, 0)), 1e-15);
  EXPECT_EQ(camera.name, "a");
  EXPECT_EQ(camera.image, dir / "images/a.png");
}

TEST(Nerf, ReadsTheFirstNerfsFiles) {
  const TempDir dir;
  dir.write("t.json",
            R"({"camera_angle_x": 1.0, "frames": [{"file_path": "./train/r_0", )" + std::string(kIdentity) + "}]}");
  EXPECT_ERROR(import_nerf(dir / "t.json"), "train/r_0");
  dir.write("train/x", "");
  save_image(Image(PixelFamily::kRgb, 8, 6), dir / "train/r_0.png");
  const Camera camera = import_nerf(dir / "t.json").rig.cameras.at(0);
  EXPECT_EQ(camera.width, 8);
  EXPECT_EQ(camera.lens, Lens::pinhole(4 / std::tan(0.5), 3.5, 2.5));
}

TEST(Nerf, ANameTooLongForAFileIsThatOfNone) {
  const TempDir dir;
  const std::string name(300, 'a');
  dir.write("t.json", R"({"w": 4, "h": 3, "fl_x": 5, "frames": [{"file_path": ")" + name + "\", " + kIdentity + "}]}");
  EXPECT_EQ(import_nerf(dir / "t.json").rig.cameras.at(0).image, dir / name);
  EXPECT_ERROR(load_image(dir / name), "no such image file");
}

TEST(Nerf, RoundTripsEveryModelWithin1e9Pixels) {
  const TempDir dir;
  const Rig rig = mixed_rig();
  const RigExport result = export_nerf(rig, dir / "t.json");
  EXPECT_LE(result.max_error, 1e-9);
  const Rig back = import_nerf(dir / "t.json").rig;
  for (const double distance : {0.5, 3.0, 100.0}) EXPECT_LE(max_reprojection_error(rig, back, distance), 1e-9);
  EXPECT_EQ(back.cameras[3].name, "cam_3");
}

TEST(Nerf, WhatWeLackIsRefusedByPlace) {
  const TempDir dir;
  const std::string size = R"("w": 4, "h": 3, )";
  const auto error = [&](const std::string& text) {
    dir.write("t.json", text);
    return text_of_error([&] { import_nerf(dir / "t.json"); });
  };
  const std::string file = dir / "t.json";
  EXPECT_EQ(error(one_frame(size + R"("fl_x": 5, "camera_model": "OPENCV_FISHEYE", )")),
            file + ": camera_model: no lens of ours equals its OPENCV_FISHEYE without loss");
  EXPECT_EQ(error(one_frame(size + R"("fl_x": 5, )", R"("k3": 0.1, )")),
            file + ": frames[0].k3: is set, and no lens of ours has it");
  EXPECT_EQ(error(one_frame(size + R"("fl_x": 5, "is_fisheye": true, )")),
            file + ": is_fisheye: is set, and no lens of ours has it");
  EXPECT_EQ(error(one_frame(size)), file + ": frames[0]: has neither fl_x nor a camera_angle_x between 0 and pi");
  EXPECT_EQ(error(R"({"frames": []})"), file + ": frames: must not be empty");
}

}  // namespace
}  // namespace lf
