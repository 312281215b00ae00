// SPDX-License-Identifier: LGPL-2.1-or-later
#include <opencv2/core.hpp>

#include "rig/exchange.h"
#include "support/expect_error.h"
#include "support/rigs.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

struct OpenCvYaml : testing::Test {
  RigImport read(const std::string& text) const {
    return import_opencv_yaml(dir.write("x.yml", "%YAML:1.0\n---\n" + text));
  }
  std::string error(const std::string& text) const {
    return text_of_error([&] { read(text); });
  }
  const TempDir dir;
};

const std::string kSize = "image_width: 4\nimage_height: 3\n";
const std::string kMatrix =
    "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
    "   data: [ 5., 0., 2., 0., 6., 1.5, 0., 0., 1. ]\n";

TEST_F(OpenCvYaml, RoundTripsEveryModelWithin1e9Pixels) {
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

TEST_F(OpenCvYaml, OpenCvReadsOurFiles) {
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

TEST_F(OpenCvYaml, ReadsASingleCamera) {
  const std::string head =
      kSize + kMatrix + "distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n";
  const Camera camera = read(head + "   data: [ -0.1, 0., 0., 0., 0. ]\n").rig.cameras.at(0);
  EXPECT_EQ(camera.lens, Lens(LensModel::kOpenCv, {5, 6, 2, 1.5, -0.1, 0, 0, 0}));
  EXPECT_EQ(camera.pose, Pose());
  EXPECT_EQ(read(head + "   data: [ -0.1, 0., 0., 0., 0.2 ]\n").rig.cameras.at(0).lens,
            Lens(LensModel::kFullOpenCv, {5, 6, 2, 1.5, -0.1, 0, 0, 0, 0.2, 0, 0, 0}));
}

TEST_F(OpenCvYaml, ErrorsNameFileAndPlace) {
  EXPECT_MENTIONS(error("cameras: []\n"), dir / "x.yml", "cameras", "1 to 65535 cameras");
  EXPECT_MENTIONS(error("cameras:\n   - { image_width: 4 }\n"), "cameras[0]");
  EXPECT_MENTIONS(error(kSize + "camera_matrix:\n   rows: 3\n   cols: 3\n   data: [1, 2]\n"),
                  "camera_matrix.data: must ");
  EXPECT_MENTIONS(error(kSize + kMatrix + "R: { rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 2] }\n"),
                  "R:", "rotation");
  EXPECT_ERROR(import_opencv_yaml(dir / "none.yml"), "none.yml", "read");
}

// The format of OpenCV and ROS for a single camera.
std::string single(const std::string& more, const std::string& terms = "[-0.1, 0.02, 0.001, -0.002]") {
  return "image_width: 1280.0\nimage_height: 960\n" + more +
         "camera_matrix: { rows: 3, cols: 3, data: [402.5, 0, 641.2, 0, 402.1, 478.9, 0, 0, 1] }\n"
         "distortion_coefficients: { rows: 1, cols: 4, data: " +
         terms + " }\n";
}

TEST_F(OpenCvYaml, OtherLensModelsAreRefused) {
  for (const std::string key :
       {"xi: 1.2", "skew: 0.1", "camera_model: omnidirectional", "rolling_shutter_readout_time: 0.02"})
    EXPECT_MENTIONS(error(single(key + "\n")), "cannot be imported") << key;
  std::string rational = single("distortion_model: rational_polynomial\n", "[0.31, -0.02, 0, 0, 0, 0.68, 0.04, 0]");
  rational.replace(rational.find("cols: 4"), 7, "cols: 8");
  EXPECT_EQ(read(rational).rig.cameras.at(0).lens,
            Lens(LensModel::kFullOpenCv, {402.5, 402.1, 641.2, 478.9, 0.31, -0.02, 0, 0, 0, 0.68, 0.04, 0}));
  std::string tilted = single("", "[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0.01, 0]");
  tilted.replace(tilted.find("cols: 4"), 7, "cols: 14");
  EXPECT_MENTIONS(error(tilted), "camera_matrix", "term 12", "tilt");
  for (const std::string key :
       {"distortion_model: plumb_bob", "fisheye_model: 0", "distortion_model: none", "camera_name: left"})
    EXPECT_EQ(error(single(key + "\n")), "no lf::Error was thrown") << key;
  EXPECT_EQ(import_opencv_yaml(dir / "x.yml").rig.cameras.at(0).name, "left");
  EXPECT_EQ(import_opencv_yaml(dir / "x.yml").rig.cameras.at(0).width, 1280);
  EXPECT_MENTIONS(error("K: [1, 2]\n"), "none", "keys");
}

TEST_F(OpenCvYaml, ReadsAndWritesFisheyeLenses) {
  const Lens fisheye(LensModel::kOpenCvFisheye, {402.5, 402.1, 641.2, 478.9, -0.1, 0.02, 0.001, -0.002});
  for (const std::string key : {"distortion_model: equidistant", "distortion_model: fisheye", "fisheye_model: 1"})
    EXPECT_EQ(read(single(key + "\n")).rig.cameras.at(0).lens, fisheye) << key;
  Rig rig = read(single("fisheye_model: 1\n")).rig;
  rig.cameras.push_back(rig.cameras[0]);
  rig.cameras[1].lens = Lens(LensModel::kFullOpenCv, {402, 403, 641, 478, 0.1, 0.2, 0.001, 0.002, 0.3, 0.4, 0.5, 0.6});
  EXPECT_LE(export_opencv_yaml(rig, dir / "back.yml").max_error, 1e-9);
  const Rig back = import_opencv_yaml(dir / "back.yml").rig;
  for (size_t i = 0; i < 2; i++) EXPECT_EQ(back.cameras[i].lens, rig.cameras[i].lens);
  rig.cameras[1].lens = Lens(LensModel::kThinPrismFisheye, {402, 403, 641, 478, 0, 0, 0.1, 0, 0, 0, 0, 0});
  EXPECT_ERROR(export_opencv_yaml(rig, dir / "back.yml"), "camera 0", "THIN_PRISM_FISHEYE");
}

std::string two_cameras(const std::string& first, const std::string& second) {
  const std::string lens =
      "{ image_width: 4, image_height: 3, camera_matrix: { rows: 3, cols: 3, data: [5, 0, 2, 0, 5, 1, 0, 0, 1] }";
  return "cameras: [ " + lens + first + " }, " + lens + second + " } ]\n";
}

const std::string kR = ", R: { rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1] }",
                  kT = ", T: { rows: 3, cols: 1, data: [-1, 0, 0] }";

// calibrateCamera() and solvePnP() return rvec and tvec.
TEST_F(OpenCvYaml, CamerasOfAListNeedPoses) {
  const auto error_with = [&](const std::string& place) { return error(two_cameras(place, place)); };
  EXPECT_MENTIONS(error_with(""), "cameras[1]", "R (3x3)", "T (3x1)", "missing");
  EXPECT_MENTIONS(error_with(", tvec: [1, 2, 3]"), "tvec", "as T");
  EXPECT_MENTIONS(error_with(kT), "x.yml", "cameras[0]", "no R");
  EXPECT_MENTIONS(error_with(kR), "x.yml", "cameras[0]", "no T");
  EXPECT_EQ(error_with(kR + kT), "no lf::Error was thrown");
  EXPECT_ERROR(import_opencv_yaml(dir.write("x.xml", "<?xml version=\"1.0\"?>\n<opencv_storage>")), "x.xml", "XML");
}

// The first camera is the only one that can define the world coordinates.
TEST_F(OpenCvYaml, FirstCameraMayLackAPose) {
  EXPECT_EQ(read(two_cameras("", kR + kT)).rig.cameras.at(1).pose.position, Vec3(1, 0, 0));
  EXPECT_MENTIONS(error(two_cameras(kR + kT, "")), "cameras[1]", "R (3x3)", "T (3x1)");
}

TEST_F(OpenCvYaml, NotesMissingDistortionCoefficients) {
  std::string text = single("");
  EXPECT_THAT(read(text).notes, IsEmpty());
  text.resize(text.find("distortion_coefficients"));
  EXPECT_THAT(read(text).notes, ElementsAre(HasSubstr("distortion_coefficients is missing")));
}

TEST_F(OpenCvYaml, ListsUnreadKeys) {
  EXPECT_THAT(read(single("exposure: 4\nflags: 10\nboard_width: 9\n")).notes,
              ElementsAre(AllOf(mentions("not read", "exposure"), testing::Not(HasSubstr("flags")))));
}

TEST_F(OpenCvYaml, ReadsTheStereoSample) {
  const std::string head = "%YAML:1.0\n---\n", size = "image_size: [ 640, 480 ]\n";
  const std::string lenses =
      "M1: { rows: 3, cols: 3, data: [400, 0, 320, 0, 401, 240, 0, 0, 1] }\n"
      "D1: { rows: 1, cols: 5, data: [-0.1, 0, 0, 0, 0] }\n"
      "M2: { rows: 3, cols: 3, data: [410, 0, 322, 0, 411, 242, 0, 0, 1] }\n"
      "D2: { rows: 1, cols: 4, data: [0, 0, 0, 0] }\n";
  const std::string places =
      "R: { rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1] }\nT: { rows: 3, cols: 1, data: [-0.12, 0, 0] }\n";
  const auto read_intrinsics = [&](const std::string& text) {
    return import_opencv_yaml(dir.write("intrinsics.yml", head + text));
  };
  EXPECT_ERROR(read_intrinsics(lenses + places), "image_width", "image_height");
  EXPECT_ERROR(read_intrinsics(size + lenses), "R and T", "second camera");
  EXPECT_ERROR(read_intrinsics(size + lenses + places.substr(0, places.find("T:"))), "no T");
  const RigImport whole = read_intrinsics(size + lenses + places);
  ASSERT_EQ(whole.rig.cameras.size(), 2u);
  EXPECT_EQ(whole.rig.cameras[0].pose, Pose());
  EXPECT_LT(glm::length(whole.rig.cameras[1].pose.position - Vec3(0.12, 0, 0)), 1e-15);
  EXPECT_EQ(whole.rig.cameras[1].lens, Lens(LensModel::kPinhole, {410, 411, 322, 242}));
  EXPECT_EQ(whole.rig.cameras[0].width, 640);
  EXPECT_THAT(whole.notes, ElementsAre(mentions("0.12 m", "metres")));
  dir.write("extrinsics.yml", head + places + "R1: { rows: 1, cols: 1, data: [1] }\n");
  const RigImport beside = read_intrinsics(size + lenses);
  EXPECT_EQ(beside.rig.cameras[1].pose, whole.rig.cameras[1].pose);
  EXPECT_THAT(beside.notes.at(0), HasSubstr("extrinsics.yml"));
}

// Kalibr's format: sequences are not indented below their keys.
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

struct Kalibr : testing::Test {
  RigImport read(const std::string& text) const { return import_kalibr(dir.write("x.yaml", text)); }
  const TempDir dir;
};

TEST_F(Kalibr, ReadsAStereoPair) {
  const Rig rig = read(kStereo).rig;
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

TEST_F(Kalibr, RoundTripsEveryModelWithin1e9Pixels) {
  const Rig rig = mixed_rig();
  const RigExport result = export_kalibr(rig, dir / "x.yaml");
  EXPECT_LE(result.max_error, 1e-9);
  EXPECT_EQ(result.notes.size(), 2u) << "ids and images";
  const Rig back = import_kalibr(dir / "x.yaml").rig;
  for (const double distance : {0.5, 3.0, 100.0}) EXPECT_LE(max_reprojection_error(rig, back, distance), 1e-9);
  EXPECT_EQ(back.cameras[3].name, "cam_3");
}

TEST_F(Kalibr, ReadsAndWritesEquidistantLenses) {
  std::string text = kStereo;
  text.replace(text.find("radtan"), 6, "equidistant");
  Rig rig = read(text).rig;
  EXPECT_EQ(rig.cameras[0].lens,
            Lens(LensModel::kOpenCvFisheye, {458.654, 457.296, 367.215, 248.375, -0.28, 0.07, 0.00019, 1.76e-05}));
  EXPECT_LE(export_kalibr(rig, dir / "back.yaml").max_error, 1e-9);
  EXPECT_EQ(import_kalibr(dir / "back.yaml").rig.cameras[0].lens, rig.cameras[0].lens);
  rig.cameras[1].lens = Lens(LensModel::kFullOpenCv, {400, 400, 320, 240, 0.1, 0, 0, 0, 0.1, 0, 0, 0});
  EXPECT_ERROR(export_kalibr(rig, dir / "back.yaml"), "camera 1", "Kalibr");
}

TEST_F(Kalibr, UnsupportedFeaturesAreErrorsWithThePlace) {
  const std::string file = dir / "x.yaml";
  const struct {
    const char *from, *to;
    std::vector<std::string> facts;
  } cases[] = {
      {"radtan", "fov", {file, "cam0.distortion_model", "imported"}},
      {"pinhole", "omni", {file, "cam0.camera_model", "imported"}},
      {"radtan", "rational_polynomial", {"cam0.distortion_model", "hold"}},
      {"resolution: [752, 480]\n  rostopic", "line_delay: 2e-5\n  rostopic", {"cam0.line_delay: is 2e-05"}},
      {"[458.654, ", "[", {file, "cam0.intrinsics", "[fx, fy, cx, cy]"}},
      {"[458.654, 457.296, 367.215, 248.375]", "[458,654, 457,296, 367,215, 248,375]", {"with a point"}},
      {"- [0.0, 1.0,", "- [0.0, 9.0,", {file, "cam1.T_cn_cnm1", "rotation"}},
      {"T_cn_cnm1", "T", {file}},
      {"cam0", "cam7", {"cam0"}},
  };
  for (const auto& [from, to, facts] : cases) {
    std::string text = kStereo;
    text.replace(text.find(from), strlen(from), to);
    EXPECT_ERROR(read(text), facts) << to;
  }
}

// Returns a camera's T_cam_imu, `x` metres to the left of the IMU.
std::string at_imu(const char* key, double x) {
  return std::string("  ") + key + ": [[1, 0, 0, " + std::to_string(x) +
         "], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n";
}

std::string plain_camera(int number) {
  return "cam" + std::to_string(number) +
         ":\n  camera_model: pinhole\n  intrinsics: [400, 400, 320, 240]\n  distortion_model: none\n"
         "  resolution: [640.0, 480]\n";
}

TEST_F(Kalibr, TimeShiftsBecomeTimeOffsets) {
  const Rig rig = read(plain_camera(0) + "  timeshift_cam_imu: 0.0019\n" + plain_camera(1) + at_imu("T_cn_cnm1", -0.1) +
                       "  timeshift_cam_imu: -0.025\n")
                      .rig;
  EXPECT_EQ(rig.cameras.at(0).time_offset, 0.0019);
  EXPECT_EQ(rig.cameras.at(1).time_offset, -0.025);
  EXPECT_EQ(rig.cameras.at(1).width, 640);
  EXPECT_TRUE(export_kalibr(rig, dir / "y.yaml").notes.empty()) << "written, too";
  EXPECT_EQ(import_kalibr(dir / "y.yaml").rig.cameras.at(1).time_offset, -0.025);
}

TEST_F(Kalibr, PoseThatContradictsTheChainIsNoted) {
  const auto notes_of = [&](double x) {
    const RigImport import = read(plain_camera(0) + at_imu("T_cam_imu", 0.05) + plain_camera(1) +
                                  at_imu("T_cn_cnm1", -0.1) + at_imu("T_cam_imu", x));
    EXPECT_NEAR(import.rig.cameras.at(1).pose.position.x, 0.05, 1e-12) << "by the chain";
    return import.notes;
  };
  EXPECT_THAT(notes_of(-0.0501), IsEmpty()) << "rounding";
  EXPECT_THAT(notes_of(-0.5), ElementsAre(mentions("cam1", "T_cn_cnm1", "T_cam_imu", "0.45 m")));
}

TEST_F(Kalibr, CamerasAfterAGapAreKeptOrRefused) {
  const std::string two = plain_camera(0) + at_imu("T_cam_imu", 0) + plain_camera(1) + at_imu("T_cn_cnm1", -0.1);
  const Rig rig = read(two + plain_camera(10) + at_imu("T_cn_cnm1", -0.1) + at_imu("T_cam_imu", -0.3) +
                       plain_camera(12) + at_imu("T_imu_cam", 0.5))
                      .rig;
  ASSERT_EQ(rig.cameras.size(), 4u);
  EXPECT_EQ(rig.cameras[2].id, 10u);
  EXPECT_EQ(rig.cameras[2].name, "cam10") << "by number, not by letter";
  EXPECT_NEAR(rig.cameras[2].pose.position.x, 0.3, 1e-12);
  EXPECT_NEAR(rig.cameras[3].pose.position.x, 0.5, 1e-12);
  EXPECT_ERROR(read(two + plain_camera(3) + at_imu("T_cn_cnm1", -0.1)), "cam3.T_cn_cnm1", "cam2");
  EXPECT_ERROR(read(two + plain_camera(3)), "cam3", "\"T_cn_cnm1\"", "missing");
  EXPECT_ERROR(read(two + plain_camera(2) + "cam02:\n  x: 1\n"), "cam02", "cam2", "same number");
}

TEST_F(Kalibr, ListsUnreadKeys) {
  EXPECT_THAT(read(plain_camera(0) + "  exposure: 3\nimu0:\n  rate: 200\n").notes,
              ElementsAre(mentions("not read", "exposure", "imu0")));
}

}  // namespace
}  // namespace lf
