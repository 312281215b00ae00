// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"

#include "image/image.h"
#include "support/expect_error.h"
#include "support/rigs.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

const std::string kIdentity = R"("transform_matrix": [[1, 0, 0, 7], [0, 1, 0, 8], [0, 0, 1, 9], [0, 0, 0, 1]])";

struct Nerf : testing::Test {
  RigImport read(const std::string& text) const { return import_nerf(dir.write("t.json", text)); }
  const TempDir dir;
};

std::string one_frame(const std::string& top, const std::string& frame = "") {
  return "{" + top + R"("frames": [{"file_path": "./images/a.png", )" + frame + kIdentity + "}]}";
}

TEST_F(Nerf, ConventionsOfPixelsAndAxes) {
  const std::string t = one_frame(R"("fl_x": 400, "fl_y": 410, "cx": 160, "cy": 120, "w": 320, "h": 240, )");
  const Camera camera = read(t).rig.cameras.at(0);
  EXPECT_EQ(camera.lens, Lens(LensModel::kPinhole, {400, 410, 159.5, 119.5}));
  EXPECT_EQ(camera.pose.position, Vec3(7, 8, 9));
  EXPECT_LT(glm::length(camera.pose.forward() - Vec3(0, 0, -1)), 1e-15) << "NeRF looks along -z";
  EXPECT_LT(glm::length(camera.pose.down() - Vec3(0, -1, 0)), 1e-15) << "its y is up";
  EXPECT_LT(glm::length(camera.pose.right() - Vec3(1, 0, 0)), 1e-15);
  EXPECT_EQ(camera.name, "a");
  EXPECT_EQ(camera.image, dir / "images/a.png");
}

TEST_F(Nerf, ReadsTheOriginalNerfFiles) {
  const std::string text = R"({"camera_angle_x": 1.0, "frames": [{"file_path": "./train/r_0", )" + kIdentity + "}]}";
  EXPECT_ERROR(read(text), "train/r_0");
  save_image(Image(PixelFamily::kRgb, 8, 6), dir.write("train/r_0.png", ""));
  const Camera camera = read(text).rig.cameras.at(0);
  EXPECT_EQ(camera.width, 8);
  EXPECT_EQ(camera.lens, Lens::pinhole(4 / std::tan(0.5), 3.5, 2.5));
}

TEST_F(Nerf, TooLongFileNamesDoNotExist) {
  const std::string name(300, 'a');
  const std::string text =
      R"({"w": 4, "h": 3, "fl_x": 5, "frames": [{"file_path": ")" + name + "\", " + kIdentity + "}]}";
  EXPECT_EQ(read(text).rig.cameras.at(0).image, dir / name);
  EXPECT_ERROR(load_image(dir / name), "no such image");
}

TEST_F(Nerf, RoundTripsEveryModelWithin1e9Pixels) {
  const Rig rig = mixed_rig();
  const RigExport result = export_nerf(rig, dir / "t.json");
  EXPECT_LE(result.max_error, 1e-9);
  const Rig back = import_nerf(dir / "t.json").rig;
  for (const double distance : {0.5, 3.0, 100.0}) EXPECT_LE(max_reprojection_error(rig, back, distance), 1e-9);
  EXPECT_EQ(back.cameras[3].name, "cam_3");
}

TEST_F(Nerf, UnsupportedFeaturesAreErrorsWithThePlace) {
  const std::string size = R"("w": 4, "h": 3, )";
  const std::string file = dir / "t.json";
  const auto refuses = [&](const std::string& text, const std::string& place) {
    EXPECT_THAT(text_of_error([&] { read(text); }),
                AllOf(StartsWith(file + ": " + place + ": "), HasSubstr("cannot be imported"), HasSubstr("undistort")));
  };
  refuses(one_frame(size + R"("fl_x": 5, "camera_model": "FISHEYE624", )"), "camera_model");
  refuses(one_frame(size + R"("fl_x": 5, )", R"("k5": 0.1, )"), "frames[0].k5");
  EXPECT_ERROR(read(one_frame(size + R"("fl_x": 5, "is_fisheye": true, "p1": 0.1, )")), "frames[0]", "p1 = p2 = 0");
  refuses(one_frame(size + R"("fl_x": 5, "sk_x": 0.1, )"), "sk_x");
  EXPECT_ERROR(read(one_frame(size + R"("fl_x": 5, "distortion_params": [0.1, 0, 0, 0.2, 0, 0], )")), "frames[0]", "k4",
               "0");
  EXPECT_ERROR(read(one_frame(size)), file, "frames[0]", "fl_x", "camera_angle_x");
  EXPECT_ERROR(read(one_frame(size + R"("fl_x": 0, )")), file, "frames[0]", "fl_x is 0");
  EXPECT_ERROR(read(R"({"frames": []})"), file, "frames", "empty");
}

// The camera models of nerfstudio 1.1 (CAMERA_MODEL_TO_TYPE in nerfstudio/cameras/cameras.py).
TEST_F(Nerf, ReadsOrRefusesAllCameraModels) {
  const auto file = [](const char* model) {
    return one_frame(std::string(R"("w": 4, "h": 3, "fl_x": 5, "k1": 0.1, "camera_model": ")") + model + "\", ");
  };
  for (const char* model : {"SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV"})
    EXPECT_EQ(read(file(model)).rig.cameras.at(0).lens.distortion().k[0], 0.1) << model;
  EXPECT_EQ(read(file("OPENCV_FISHEYE")).rig.cameras.at(0).lens.model(), LensModel::kOpenCvFisheye);
  for (const char* model : {"EQUIRECTANGULAR", "OMNIDIRECTIONALSTEREO_L", "OMNIDIRECTIONALSTEREO_R", "VR180_L",
                            "VR180_R", "ORTHOPHOTO", "FISHEYE624"})
    EXPECT_ERROR(read(file(model)), dir / "t.json", "camera_model", model, "cannot be imported");
}

TEST_F(Nerf, ReadsFisheyeLensesAndK3) {
  const std::string size = R"("w": 640, "h": 480, "fl_x": 200, "k1": 0.1, "k2": 0.2, "k3": 0.3, )";
  const Lens fisheye(LensModel::kOpenCvFisheye, {200, 200, 319.5, 239.5, 0.1, 0.2, 0.3, 0.4});
  for (const char* key : {R"("is_fisheye": true, "k4": 0.4, )", R"("camera_model": "OPENCV_FISHEYE", "k4": 0.4, )",
                          R"("is_fisheye": true, "distortion_params": [0.1, 0.2, 0.3, 0.4, 0, 0], )"})
    EXPECT_EQ(read(one_frame(size + key)).rig.cameras.at(0).lens, fisheye) << key;
  const Lens with_k3(LensModel::kFullOpenCv, {200, 200, 319.5, 239.5, 0.1, 0.2, 0, 0, 0.3, 0, 0, 0});
  Rig rig = read(one_frame(size)).rig;
  EXPECT_EQ(rig.cameras.at(0).lens, with_k3);
  for (const Lens& lens : {with_k3, fisheye}) {
    rig.cameras[0].lens = lens;
    EXPECT_LE(export_nerf(rig, dir / "back.json").max_error, 1e-9);
    EXPECT_EQ(import_nerf(dir / "back.json").rig.cameras.at(0).lens, lens);
  }
  rig.cameras.push_back(rig.cameras[0]);
  rig.cameras[1].lens = with_k3;
  EXPECT_ERROR(export_nerf(rig, dir / "back.json"), "fisheye lenses beside");
  rig.cameras[0].lens = Lens(LensModel::kFullOpenCv, {200, 200, 319.5, 239.5, 0.1, 0.2, 0, 0, 0.3, 0.1, 0, 0});
  EXPECT_ERROR(export_nerf(rig, dir / "back.json"), "k4, k5 and k6");
}

TEST_F(Nerf, WholeNumbersMayBeFloats) {
  const RigImport result =
      read(one_frame(R"("fl_x": 400, "w": 1080.0, "h": 1920.0, "aabb_scale": 4, )", R"("sharpness": 3.5, )"));
  EXPECT_EQ(result.rig.cameras.at(0).width, 1080);
  EXPECT_EQ(result.rig.cameras.at(0).height, 1920);
  EXPECT_TRUE(result.notes.empty());
}

TEST_F(Nerf, ReadsNerfstudioFiles) {
  const RigImport result =
      read(one_frame(R"("w": 640, "h": 480, "fl_x": 400, "camera_model": "OPENCV", "k3": 0, "k4": 0.0,
      "distortion_params": [-0.1, 0.02, 0, 0, 0.001, -0.002], "ply_file_path": "sparse.ply",
      "applied_transform": [[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0]], "applied_scale": 0.5, )",
                     R"("colmap_im_id": 3, "mask_path": "m.png", )"));
  const Camera& camera = result.rig.cameras.at(0);
  EXPECT_EQ(camera.lens, Lens(LensModel::kOpenCv, {400, 400, 319.5, 239.5, -0.1, 0.02, 0.001, -0.002}));
  // The transform turns (x, y, z) to (x, z, -y); the frame is at (7, 8, 9), scaled by a half.
  EXPECT_LT(glm::length(camera.pose.position - Vec3(14, -18, 16)), 1e-12);
  EXPECT_THAT(result.notes,
              ElementsAre(mentions("not read", "mask_path"), mentions("applied_transform", "applied_scale")));
}

TEST_F(Nerf, CoefficientsOfSomeFramesAreNoted) {
  const std::string frame = R"({"file_path": "a.png", "w": 320, "h": 240, "fl_x": 400, "cx": 160, "cy": 120, )";
  const auto notes_of = [&](const std::string& top, const std::string& first) {
    return read("{" + top + R"("frames": [)" + frame + first + kIdentity + "}, " + frame + kIdentity + "}]}").notes;
  };
  EXPECT_TRUE(notes_of("", "").empty());
  EXPECT_TRUE(notes_of(R"("k1": 0.1, )", R"("k1": 0.2, )").empty()) << "the other frame has the file's";
  EXPECT_THAT(notes_of("", R"("k1": 0.2, )"), ElementsAre(mentions("1 of 2 frames", "k1")));
}

TEST_F(Nerf, FramesWithDifferentTimesAreErrors) {
  const auto at = [](const std::string& time) {
    return R"({"file_path": "a", "time": )" + time + ", " + kIdentity + "}";
  };
  const auto read_frames = [&](const std::string& a, const std::string& b) {
    return read(R"({"w": 4, "h": 3, "fl_x": 5, "frames": [)" + at(a) + "," + at(b) + "]}");
  };
  EXPECT_ERROR(read_frames("0", "0.5"), "frames[1].time", "0.5", "0");
  EXPECT_EQ(read_frames("0.5", "0.5").rig.cameras.size(), 2u);
}

TEST_F(Nerf, ParsesManyFramesInLinearTime) {
  std::string text = R"({"w": 4, "h": 3, "fl_x": 5, "frames": [)";
  for (size_t i = 0; i <= kMaxCameras; i++)
    text +=
        std::string(i ? "," : "") + R"({"file_path": "f)" + std::to_string(i) + R"(", "odd": 1, )" + kIdentity + "}";
  EXPECT_ERROR(read(text + "]}"), "frames", "65535 cameras");
}

}  // namespace
}  // namespace lf
