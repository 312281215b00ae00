// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"

#include <filesystem>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "support/expect_error.h"
#include "support/mixed_rig.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

constexpr char kMatrix[] =
    "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
    "   data: [ 5., 0., 2., 0., 6., 1.5, 0., 0., 1. ]\n";

TEST(OpenCvYaml, RoundTripsEveryModelWithin1e9Pixels) {
  const TempDir dir;
  const Rig rig = mixed_rig();
  EXPECT_LE(export_opencv_yaml(rig, dir / "x.yaml").max_error, 1e-9);
  const Rig back = import_opencv_yaml(dir / "x.yaml").rig;
  for (const double distance : {0.5, 3.0, 100.0}) EXPECT_LE(max_reprojection_error(rig, back, distance), 1e-9);
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    EXPECT_EQ(back.cameras[i].name, rig.cameras[i].name);
    EXPECT_EQ(std::filesystem::absolute(back.cameras[i].image).lexically_normal(),
              std::filesystem::absolute(rig.cameras[i].image));
    EXPECT_EQ(back.cameras[i].id, i);
  }
}

TEST(OpenCvYaml, OpenCvReadsWhatWeWrite) {
  const TempDir dir;
  const Rig rig = mixed_rig();
  export_opencv_yaml(rig, dir / "x.yaml");
  const cv::FileStorage file(dir / "x.yaml", cv::FileStorage::READ);
  const cv::FileNode camera = file["cameras"][1];
  cv::Mat k, r, t, distortion;
  camera["camera_matrix"] >> k;
  camera["distortion_coefficients"] >> distortion;
  camera["R"] >> r;
  camera["T"] >> t;
  EXPECT_EQ(static_cast<std::string>(camera["name"]), "cam_1");
  EXPECT_EQ(k.at<double>(1, 1), 410);
  EXPECT_EQ(k.at<double>(0, 2), 160);
  EXPECT_EQ(distortion.total(), 4u);
  const cv::Vec3d world(1, 2, 3);
  const cv::Mat seen = r * cv::Mat(world) + t;
  const Vec3 expected = rig.cameras[1].pose.camera_from_world(Vec3(1, 2, 3));
  for (int i = 0; i < 3; i++) EXPECT_NEAR(seen.at<double>(i), expected[i], 1e-12);
}

TEST(OpenCvYaml, ReadsTheFileOfOneCamera) {
  const TempDir dir;
  const std::string head = "%YAML:1.0\n---\nimage_width: 4\nimage_height: 3\n";
  const std::string terms = "distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n";
  dir.write("x.yml", head + kMatrix + terms + "   data: [ -0.1, 0., 0., 0., 0. ]\n");
  const Camera camera = import_opencv_yaml(dir / "x.yml").rig.cameras.at(0);
  EXPECT_EQ(camera.lens, Lens(LensModel::kOpenCv, {5, 6, 2, 1.5, -0.1, 0, 0, 0}));
  EXPECT_EQ(camera.pose, Pose());
  dir.write("x.yml", head + kMatrix + terms + "   data: [ -0.1, 0., 0., 0., 0.2 ]\n");
  EXPECT_ERROR(import_opencv_yaml(dir / "x.yml"), dir / "x.yml" + ": distortion_coefficients: k3 is not 0");
}

TEST(OpenCvYaml, ErrorsNameFileAndPlace) {
  const TempDir dir;
  const auto error = [&](const std::string& text) {
    dir.write("x.yml", "%YAML:1.0\n---\n" + text);
    return text_of_error([&] { import_opencv_yaml(dir / "x.yml"); });
  };
  EXPECT_EQ(error("cameras: []\n"), dir / "x.yml" + ": cameras: must be 1 to 65535 cameras");
  EXPECT_NE(error("cameras:\n   - { image_width: 4 }\n").find("cameras[0]"), std::string::npos);
  EXPECT_NE(error("image_width: 4\nimage_height: 3\ncamera_matrix:\n   rows: 3\n   cols: 3\n   data: [1, 2]\n")
                .find("camera_matrix.data: must "),
            std::string::npos);
  EXPECT_NE(error(std::string("image_width: 4\nimage_height: 3\n") + kMatrix +
                  "R: { rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 2] }\n")
                .find("R: must be a rotation"),
            std::string::npos);
  EXPECT_ERROR(import_opencv_yaml(dir / "none.yml"), "none.yml: can't be read");
}

}  // namespace
}  // namespace lf
