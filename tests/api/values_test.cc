// SPDX-License-Identifier: LGPL-2.1-or-later
#include <lightfield/version.h>

#include "api/api_fixture.h"
#include "support/temp_dir.h"

namespace lightfield {
namespace {

std::vector<Camera> four_cameras() {
  std::vector<Camera> cameras(4);
  for (uint32_t i = 0; i < 4; i++) {
    cameras[i].id = 10 + i;
    cameras[i].name = "camera " + std::to_string(i);
    cameras[i].width = 160;
    cameras[i].height = 120;
    cameras[i].lens = {.fx = 150, .fy = 151, .cx = 79.5, .cy = 59.5};
    cameras[i].world_from_camera.position = {0.2 * (i % 2), 0.2 * (i / 2), 0};
  }
  return cameras;
}

TEST(ApiVersion, HeadersLibraryAndBuildAgree) {
  EXPECT_EQ(version(), std::to_string(LIGHTFIELD_VERSION_MAJOR) + "." + std::to_string(LIGHTFIELD_VERSION_MINOR) + "." +
                           std::to_string(LIGHTFIELD_VERSION_PATCH));
  EXPECT_TRUE(LIGHTFIELD_VERSION_AT_LEAST(0, 1, 0));
  EXPECT_FALSE(LIGHTFIELD_VERSION_AT_LEAST(LIGHTFIELD_VERSION_MAJOR, LIGHTFIELD_VERSION_MINOR, 999));
}

TEST(ApiRig, KeepsAllMembers) {
  std::vector<Camera> cameras = four_cameras();
  cameras[2].lens = {150.25, 151.5, 80, 60, -0.1, 0.01, 0.001, -0.002};
  cameras[3].world_from_camera.orientation = {std::sqrt(0.5), 0, std::sqrt(0.5), 0};
  const Rig rig(cameras, {Topology::Type::kGrid, 2, 2, {}});
  ASSERT_EQ(rig.size(), 4u);
  EXPECT_EQ(rig.camera(1).id, 11u);
  EXPECT_EQ(rig.camera(1).name, "camera 1");
  EXPECT_EQ(rig.camera(2).lens.p2, -0.002);
  EXPECT_EQ(rig.camera(2).lens.fy, 151.5);
  EXPECT_EQ(rig.camera(3).world_from_camera.orientation.y, std::sqrt(0.5));
  EXPECT_EQ(rig.camera(3).world_from_camera.position.x, 0.2);
  EXPECT_EQ(parse_rig(rig.json()).hash(), rig.hash());
  cameras[0].lens.cx += 1e-9;
  EXPECT_NE(Rig(cameras, {Topology::Type::kGrid, 2, 2, {}}).hash(), rig.hash());
  const Rig triangles(cameras, {Topology::Type::kTriangles, 0, 0, {{0, 1, 2}, {1, 3, 2}}});
  EXPECT_NE(triangles.hash(), rig.hash());
}

TEST(ApiRig, KeepsEveryLensModel) {
  std::vector<Camera> cameras = four_cameras();
  cameras[0].lens = {.fx = 150, .fy = 151, .cx = 80, .cy = 60, .k1 = 0.1, .k2 = 0.2, .p1 = 0.01, .p2 = 0.02, .k3 = 0.3,
                     .k4 = 0.4, .k5 = 0.5, .k6 = 0.6};
  cameras[1].lens = {.fx = 150, .fy = 151, .cx = 80, .cy = 60, .k1 = 0.1, .k2 = 0.2, .k3 = 0.3, .k4 = 0.4,
                     .fisheye = true};
  cameras[2].lens = cameras[1].lens;
  cameras[2].lens.s2 = 0.05;
  const std::string json = Rig(cameras).json();
  const Rig rig = parse_rig(json);
  for (const char* model : {"FULL_OPENCV", "OPENCV_FISHEYE", "THIN_PRISM_FISHEYE", "PINHOLE"})
    EXPECT_NE(json.find("\"" + std::string(model) + "\""), std::string::npos) << model;
  for (size_t i = 0; i < cameras.size(); i++) {
    const Lens is = rig.camera(i).lens, was = cameras[i].lens;
    EXPECT_EQ(std::vector({is.k1, is.k2, is.k3, is.k4, is.k5, is.k6, is.p1, is.p2, is.s1, is.s2}),
              std::vector({was.k1, was.k2, was.k3, was.k4, was.k5, was.k6, was.p1, was.p2, was.s1, was.s2}));
    EXPECT_EQ(is.fisheye, was.fisheye);
  }
  cameras[1].lens.k5 = 0.1;
  EXPECT_API_ERROR(Rig{cameras}, "cameras[1].lens", "k5", "fisheye");
  cameras[1].lens = {.s1 = 0.1};
  EXPECT_API_ERROR(Rig{cameras}, "cameras[1].lens", "s1", "fisheye");
}

TEST(ApiRig, FilesKeepUnknownKeys) {
  const TempDir dir;
  std::string text = Rig(four_cameras()).json();
  text.replace(text.find("\"id\":11"), 7, "\"sticker\":\"red\",\"id\":11");
  dir.write("rig.json", text);
  save_rig(load_rig(dir / "rig.json"), dir / "copy.json");
  EXPECT_NE(lf::read_text_file(dir / "copy.json").find("\"sticker\":\"red\""), std::string::npos);
  EXPECT_EQ(load_rig(dir / "copy.json").hash(), Rig(four_cameras()).hash());
}

TEST(ApiRig, ErrorsNameTheMember) {
  const auto with = [](auto change, const Topology& topology = {}) {
    std::vector<Camera> cameras = four_cameras();
    change(cameras);
    return test::error_of([&] { Rig(cameras, topology); });
  };
  const auto nothing = [](std::vector<Camera>&) {};
  using testing::PrintToString;
  EXPECT_MENTIONS(with([](auto& c) { c.clear(); }), "rig:", "cameras:", "one camera");
  EXPECT_MENTIONS(with([](auto& c) { c[1].id = 10; }), "rig", "cameras[1].id", "10", "cameras[0]");
  EXPECT_MENTIONS(with([](auto& c) { c[2].lens.fy = -1; }), "cameras[2].lens", "params[1]", "focal length", "positive");
  EXPECT_MENTIONS(with([](auto& c) { c[2].width = 0; }), "cameras[2].width");
  EXPECT_MENTIONS(with([](auto& c) { c[0].world_from_camera.position.z = NAN; }), "cameras[0].position");
  EXPECT_MENTIONS(with([](auto& c) { c[0].world_from_camera.orientation.w = 0; }), "cameras[0].orientation");
  EXPECT_MENTIONS(with([](auto& c) { c[0].name = "\xff"; }), "UTF-8");
  EXPECT_MENTIONS(with(nothing, {Topology::Type::kGrid, 3, 2, {}}), "rig", "4 cameras");
  EXPECT_MENTIONS(with(nothing, {Topology::Type::kTriangles, 0, 0, {{0, 1, 4}}}), "triangles[0][2]");
  EXPECT_API_ERROR(Rig(four_cameras()).camera(4), "camera 4", "4 cameras");
  EXPECT_API_ERROR(load_rig("/none/rig.json"), "/none/rig.json");
  EXPECT_API_ERROR(parse_rig("{}", "my.json"), "my.json: ");
  EXPECT_API_ERROR(parse_rig("{", "my.json"), "my.json: ");
  EXPECT_API_ERROR(save_rig(Rig(four_cameras()), "/none/rig.json"), "/none/rig.json");
}

TEST(ApiView, LooksAtItsTarget) {
  const Pose pose = look_at({1, 2, 3}, {1, 2, 8});
  EXPECT_NEAR(pose.orientation.w, 1, 1e-12);
  EXPECT_EQ(pose.position.z, 3);
  EXPECT_API_ERROR(look_at({1, 2, 3}, {1, 2, 3}), "eye", "target");
  EXPECT_API_ERROR(look_at({1, 2, 3}, {1, 9, 3}), "vertical");
  EXPECT_API_ERROR(look_at({1, NAN, 3}, {1, 9, 3}), "eye", "target");
}

TEST(ApiView, HomeIsInTheMiddleOfTheCameras) {
  const View view = home_view(Rig(four_cameras()), 320, 240);
  EXPECT_NEAR(view.world_from_view.position.x, 0.1, 1e-12);
  EXPECT_NEAR(view.world_from_view.position.y, 0.1, 1e-12);
  EXPECT_NEAR(view.fov_y, 2 * std::atan(60 / 151.) * 180 / M_PI, 0.5);
  EXPECT_API_ERROR(home_view(Rig(four_cameras()), 0, 240), "width: ");
}

TEST(ApiImage, IsBlack) {
  const Image image = make_image(PixelFormat::kI420, 5, 3);
  EXPECT_EQ(image.pixels.size(), 15u + 2 * 6);
  EXPECT_EQ(image.pixels[0], 0);
  EXPECT_EQ(image.pixels[15], 128);
  EXPECT_EQ(ImageView(image).plane[2], image.pixels.data() + 21);
  EXPECT_API_ERROR(make_image(PixelFormat::kNone, 5, 3), "format");
  EXPECT_API_ERROR(make_image(PixelFormat::kRgb, 5, 0), "height");
}

TEST(ApiRig, KeepsColourCalibration) {
  Camera camera{.width = 64, .height = 48, .lens = {50, 50, 31.5, 23.5}};
  camera.colour = CameraColour{.black = {1, 2, 3}, .gamma = 2, .vignetting = {-0.2, 0.01}};
  const Rig rig({camera});
  const Rig again = parse_rig(rig.json());
  ASSERT_TRUE(again.camera(0).colour);
  EXPECT_EQ(again.camera(0).colour->black.z, 3);
  EXPECT_EQ(again.camera(0).colour->gamma, 2);
  EXPECT_EQ(again.camera(0).colour->matrix, CameraColour().matrix);
  EXPECT_EQ(again.camera(0).colour->vignetting[0], -0.2);
  camera.colour->gamma = 9;
  EXPECT_API_ERROR(Rig({camera}), "cameras[0].colour.gamma", "0.5 to 5");
}

}  // namespace
}  // namespace lightfield
