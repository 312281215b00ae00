// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/colmap_model.h"

#include "support/colmap_binary.h"
#include "support/expect_error.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

using test::bytes_of;

const std::map<uint32_t, ColmapCamera> kOneCamera = {{1, {"PINHOLE", 4, 3, {5, 5, 2, 1.5}, 2}}};
// Numbers that lose bits if a file has too few digits.
const std::map<uint32_t, ColmapCamera> kExactCameras = {{3, {"SIMPLE_RADIAL", 4, 3, {1e3 / 7, 2, 1.5, -1e-17}, 1}},
                                                        {1, {"OPENCV", 640, 480, {5, 6, 2, 1.5, 1, 2, 3, 4}, 2}}};
const ColmapImage kExactImage = {.id = 8,
                                 .camera_id = 3,
                                 .q = glm::normalize(Quat(0.1, -0.2, 0.3, 0.4)),
                                 .t = {1 / 3.0, -5e-324, 1.7976931348623157e308},
                                 .name = "left/a b.png"};

struct ColmapBinary : testing::Test {
  const TempDir dir;
};
using ColmapText = ColmapBinary;

std::string pinhole(uint32_t id, uint64_t width = 4, double f = 5) {
  return bytes_of(id, int32_t{1}, width, uint64_t{3}, f, 5.0, 2.0, 1.5);
}

std::string image(uint32_t id, const char* name, double w = 1, uint32_t camera = 1) {
  return bytes_of(id, w, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, camera, name);
}

std::string points(uint64_t count) {
  std::string bytes = bytes_of(count);
  for (uint64_t i = 0; i < count; i++) bytes += bytes_of(617.03, 443.58, uint64_t{1412});
  return bytes;
}

TEST_F(ColmapBinary, ReadsCamerasOfEveryModel) {
  // The number of parameters of each model, in COLMAP's order.
  constexpr size_t kParams[] = {3, 4, 4, 5, 8, 8, 12, 5, 4, 5, 12};
  std::string bytes = bytes_of(uint64_t{std::size(kParams)});
  for (int32_t model = 0; model < static_cast<int32_t>(std::size(kParams)); model++) {
    bytes += bytes_of(static_cast<uint32_t>(20 - model), model, uint64_t{1280}, uint64_t{960});
    for (size_t k = 0; k < kParams[model]; k++) bytes += bytes_of(model + static_cast<double>(k) / 16);
  }
  const auto cameras = read_colmap_cameras_binary(dir.write("cameras.bin", bytes));
  ASSERT_EQ(cameras.size(), std::size(kParams));
  for (size_t model = 0; model < std::size(kParams); model++) {
    const ColmapCamera& camera = cameras.at(static_cast<uint32_t>(20 - model));
    ASSERT_EQ(camera.params.size(), kParams[model]);
    EXPECT_EQ(camera.params.back(), static_cast<double>(model) + static_cast<double>(kParams[model] - 1) / 16);
    EXPECT_EQ(camera.width, 1280);
    EXPECT_EQ(camera.height, 960);
  }
  EXPECT_EQ(cameras.at(18).model, "SIMPLE_RADIAL");
  EXPECT_EQ(cameras.at(18).num_focal, 1u);
  EXPECT_EQ(cameras.at(15).model, "OPENCV_FISHEYE");
  EXPECT_EQ(cameras.at(10).model, "THIN_PRISM_FISHEYE");
  // The text of the same cameras.
  const auto again = read_colmap_cameras_text(dir.write("cameras.txt", colmap_cameras_file(cameras, false)));
  for (const auto& [id, camera] : cameras) {
    EXPECT_EQ(again.at(id).model, camera.model);
    EXPECT_EQ(again.at(id).params, camera.params);
    EXPECT_EQ(again.at(id).num_focal, camera.num_focal);
  }
}

TEST_F(ColmapBinary, ReadsTheSameAsText) {
  const auto back = read_colmap_cameras_binary(dir.write("cameras.bin", colmap_cameras_file(kExactCameras, true)));
  EXPECT_EQ(colmap_cameras_file(back, false), colmap_cameras_file(kExactCameras, false));
  const auto images =
      read_colmap_images_binary(dir.write("images.bin", colmap_images_file({kExactImage}, true)), kExactCameras);
  EXPECT_EQ(colmap_images_file(images, false), colmap_images_file({kExactImage}, false));
}

TEST_F(ColmapBinary, WritesTheSpecifiedBytes) {
  EXPECT_EQ(colmap_cameras_file(kOneCamera, true), bytes_of(uint64_t{1}) + pinhole(1));
  const ColmapImage image_4{4, 1, {1, 0, 0, 0}, {1, 2, 3}, "b.png"};
  EXPECT_EQ(colmap_images_file({image_4}, true), bytes_of(uint64_t{1}) + image(4, "b.png") + points(0));
  EXPECT_EQ(colmap_points_file(true), bytes_of(uint64_t{0}));
  const ColmapImage image_6{6, 2, {0.5, 0.5, 0.5, 0.5}, {1, 2, 4}, "c.png"};  // x to y, y to z, z to x
  constexpr int32_t kCamera = 0;
  EXPECT_EQ(colmap_rigs_file(9, {image_4, image_6}, true),
            bytes_of(uint64_t{1}, uint32_t{9}, uint32_t{2}, kCamera, uint32_t{1}, kCamera, uint32_t{2}, uint8_t{1}, 0.5,
                     0.5, 0.5, 0.5, -2.0, 1.0, 2.0));
  EXPECT_EQ(colmap_frames_file(9, {image_4, image_6}, true),
            bytes_of(uint64_t{1}, uint32_t{1}, uint32_t{9}, 1.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, uint32_t{2}, kCamera,
                     uint32_t{1}, uint64_t{4}, kCamera, uint32_t{2}, uint64_t{6}));
}

TEST_F(ColmapText, WritesRigsAndFrames) {
  const std::vector<ColmapImage> images = {{4, 1, {1, 0, 0, 0}, {1, 2, 3}, "b.png"},
                                           {6, 2, {0.5, 0.5, 0.5, 0.5}, {1, 2, 4}, "c.png"}};
  EXPECT_THAT(colmap_rigs_file(9, images, false),
              testing::EndsWith(")\n9 2 CAMERA 1 CAMERA 2 1 0.5 0.5 0.5 0.5 -2 1 2\n"));
  EXPECT_THAT(colmap_frames_file(9, images, false),
              testing::EndsWith(")\n1 9 1 0 0 0 1 2 3 2 CAMERA 1 4 CAMERA 2 6\n"));
}

TEST_F(ColmapBinary, ReadsImagesWithAndWithoutPoints) {
  const auto images =
      read_colmap_images_binary(dir.write("images.bin", bytes_of(uint64_t{2}) + image(9, "left/2021-05-19 20.jpg", 2) +
                                                            points(3) + image(4, "b.png") + points(0)),
                                kOneCamera);
  ASSERT_EQ(images.size(), 2u);
  EXPECT_EQ(images[1].id, 9u) << "in the order of IMAGE_ID";
  EXPECT_EQ(images[1].camera_id, 1u);
  EXPECT_EQ(images[1].q, Quat(1, 0, 0, 0)) << "normalised as in COLMAP";
  EXPECT_EQ(images[1].t, Vec3(1, 2, 3));
  EXPECT_EQ(images[1].name, "left/2021-05-19 20.jpg");
  EXPECT_EQ(images[0].id, 4u);
  EXPECT_EQ(images[0].name, "b.png");
}

TEST_F(ColmapBinary, ErrorsNameFileAndByte) {
  const double nan = std::nan("");
  const std::string one = bytes_of(uint64_t{1}), two = bytes_of(uint64_t{2});
  const InvalidText cameras[] = {
      {"", {"byte 0: the file is truncated within the number of cameras"}},
      {two + pinhole(1), {"byte 64: the file is truncated within CAMERA_ID"}},
      {one + pinhole(1).substr(0, 40), {"byte 48: the file is truncated within PARAMS[]"}},
      {one + pinhole(1) + "x", {"byte 64: more data follows"}},
      {two + pinhole(1) + pinhole(1), {"CAMERA_ID 1 occurs twice"}},
      {one + pinhole(1, 16385), {"WIDTH must be an integer from 1 to 16384, but is 16385"}},
      {one + pinhole(1, 4, nan), {"PARAMS[] must be finite"}},
      {bytes_of(uint64_t{1}, uint32_t{1}, int32_t{11}), {"unknown lens model 11"}},
      {bytes_of(uint64_t{1}, uint32_t{1}, int32_t{-1}), {"unknown lens model -1"}},
  };
  for (const auto& c : cameras) {
    const std::string path = dir.write("cameras.bin", c.text);
    EXPECT_ERROR(read_colmap_cameras_binary(path), path);
    EXPECT_ERROR(read_colmap_cameras_binary(path), c.facts);
  }
  const InvalidText images[] = {
      {one + image(1, "a.png"), {"truncated within the number of POINTS2D[]"}},
      {one + image(1, "a.png").substr(0, 66), {"truncated within NAME"}},
      {one + image(1, "a.png") + bytes_of(UINT64_MAX), {"truncated within POINTS2D[]"}},
      {bytes_of(UINT64_MAX) + image(1, "a.png") + points(1), {"truncated within IMAGE_ID"}},
      {one + image(1, "") + points(0), {"NAME is empty"}},
      {one + image(1, "caf\xe9.png") + points(0), {"NAME is not UTF-8"}},
      {one + image(1, "a.png", 0) + points(0), {"QW, QX, QY, QZ are all 0"}},
      {one + image(1, "a.png", nan) + points(0), {"QW must be finite"}},
      {one + image(1, "a.png", 1, 7) + points(0), {"CAMERA_ID 7 is not in cameras.bin"}},
      {two + image(1, "a.png") + points(0) + image(1, "b.png") + points(0), {"IMAGE_ID 1 occurs twice"}},
      {one + image(1, "a.png") + points(1) + "x", {"more data follows"}},
  };
  for (const auto& c : images) {
    const std::string path = dir.write("images.bin", c.text);
    EXPECT_ERROR(read_colmap_images_binary(path, kOneCamera), path);
    EXPECT_ERROR(read_colmap_images_binary(path, kOneCamera), c.facts);
  }
}

TEST_F(ColmapText, ReadsCamerasOfEveryModel) {
  const auto cameras = read_colmap_cameras_text(dir.write("cameras.txt",
                                                          "\xef\xbb\xbf# a comment\n"
                                                          "\n"
                                                          "  7 SIMPLE_RADIAL 1280 960 1064.91 640 480 0.0187869\r\n"
                                                          "2\tOPENCV_FISHEYE 8 8 1 2 3 4 5 6 7 8\n"
                                                          "3 THIN_PRISM_FISHEYE 8 8 1 2 3 4 5 6 7 8 9 10 11 1.2e1"));
  ASSERT_EQ(cameras.size(), 3u);
  EXPECT_EQ(cameras.at(7).model, "SIMPLE_RADIAL");
  EXPECT_EQ(cameras.at(7).width, 1280);
  EXPECT_EQ(cameras.at(7).height, 960);
  EXPECT_EQ(cameras.at(7).num_focal, 1u);
  EXPECT_EQ(cameras.at(7).params, (std::vector<double>{1064.91, 640, 480, 0.0187869}));
  EXPECT_EQ(cameras.at(2).num_focal, 2u);
  EXPECT_EQ(cameras.at(3).params.back(), 12);
}

TEST_F(ColmapText, ReadsImagesWithAndWithoutPoints) {
  const auto images = read_colmap_images_text(dir.write("images.txt",
                                                        "# a comment\n"
                                                        "9 0.6 0 0.8 0 1 2 3 1 2021-05-19 20.23.45.jpg\r\n"
                                                        "617.03 443.58 1412 657.178 573.761 -1\n"
                                                        "4 2 0 0 0 -1e-3 0 0 1 left/b.png  \n"
                                                        "\n"
                                                        "5 1 0 0 0 0 0 0 1 c"),
                                              kOneCamera);
  ASSERT_EQ(images.size(), 3u);
  EXPECT_EQ(images[0].id, 9u);
  EXPECT_EQ(images[0].q, Quat(0.6, 0, 0.8, 0));
  EXPECT_EQ(images[0].t, Vec3(1, 2, 3));
  EXPECT_EQ(images[0].name, "2021-05-19 20.23.45.jpg");
  EXPECT_EQ(images[1].q, Quat(1, 0, 0, 0)) << "normalised as in COLMAP";
  EXPECT_EQ(images[1].t, Vec3(-1e-3, 0, 0));
  EXPECT_EQ(images[1].name, "left/b.png");
  EXPECT_EQ(images[2].name, "c");
}

TEST_F(ColmapText, RoundTripsToTheLastBit) {
  const auto back = read_colmap_cameras_text(dir.write("cameras.txt", colmap_cameras_file(kExactCameras, false)));
  EXPECT_EQ(back.at(3).params, kExactCameras.at(3).params);
  EXPECT_EQ(back.at(3).model, "SIMPLE_RADIAL");
  const auto images =
      read_colmap_images_text(dir.write("images.txt", colmap_images_file({kExactImage}, false)), kExactCameras);
  ASSERT_EQ(images.size(), 1u);
  EXPECT_EQ(images[0].id, kExactImage.id);
  EXPECT_EQ(images[0].camera_id, kExactImage.camera_id);
  EXPECT_EQ(images[0].q, kExactImage.q);
  EXPECT_EQ(images[0].t, kExactImage.t);
  EXPECT_EQ(images[0].name, kExactImage.name);
}

TEST_F(ColmapText, ErrorsNameFileAndLine) {
  const InvalidText cameras[] = {
      {"x PINHOLE 4 3 5 5 2 1.5", {"CAMERA_ID", "integer", "0 to 4294967295", "\"x\""}},
      {"-1 PINHOLE 4 3 5 5 2 1.5", {"CAMERA_ID", "integer"}},
      {"1", {"MODEL", "missing"}},
      {"1 LENS 4 3 5 5 2 1.5", {"unknown", "LENS"}},
      {"1 PINHOLE 0 3 5 5 2 1.5", {"WIDTH", "integer", "1 to 16384", "\"0\""}},
      {"1 PINHOLE 4 16385 5 5 2 1.5", {"HEIGHT", "integer", "1 to 16384", "\"16385\""}},
      {"1 PINHOLE 4.5 3 5 5 2 1.5", {"WIDTH", "integer"}},
      {"1 PINHOLE 4 3 5 5 2", {"PINHOLE", "4 numbers", "3"}},
      {"1 PINHOLE 4 3 5 5 2 1.5 0", {"PINHOLE", "4 numbers", "5"}},
      {"1 PINHOLE 4 3 5 five 2 1.5", {"PARAMS[]", "finite", "number", "five"}},
      {"1 PINHOLE 4 3 nan 5 2 1.5", {"PARAMS[]", "finite", "number", "nan"}},
      {"1 PINHOLE 4 3 1e999 5 2 1.5", {"PARAMS[]", "finite", "number", "1e999"}},
      {"2 PINHOLE 4 3 5 5 2 1.5", {"CAMERA_ID 2", "twice"}},
  };
  for (const auto& c : cameras) {
    const std::string path = dir.write("cameras.txt", "#\n2 PINHOLE 4 3 5 5 2 1.5\n" + c.text + "\n");
    EXPECT_ERROR(read_colmap_cameras_text(path), path, "line 3:");
    EXPECT_ERROR(read_colmap_cameras_text(path), c.facts);
  }
  const InvalidText images[] = {
      {"1 1 0 0 0 0 0 0 1", {"NAME", "missing"}},
      {"1 1 0 0 0 0 0 0 1 caf\xe9.png", {"NAME", "UTF-8"}},
      {"1 1 0 0 0 0 0", {"TZ", "missing"}},
      {"1 0 0 0 0 0 0 0 1 a.png", {"QW, QX, QY, QZ", "rotation"}},
      {"1 1 0 inf 0 0 0 0 1 a.png", {"QY", "finite", "number", "inf"}},
      {"1 1 0 0 0 0 0 0 7 a.png", {"CAMERA_ID 7", "cameras.txt"}},
      {"2 1 0 0 0 0 0 0 1 a.png", {"IMAGE_ID 2", "twice"}},
  };
  for (const auto& c : images) {
    const std::string path = dir.write("images.txt", "2 1 0 0 0 0 0 0 1 z.png\n\n" + c.text + "\n");
    EXPECT_ERROR(read_colmap_images_text(path, kOneCamera), path, "line 3:");
    EXPECT_ERROR(read_colmap_images_text(path, kOneCamera), c.facts);
  }
  // Without POINTS2D lines, every second image would be read as points.
  const std::string path = dir.write("images.txt", "1 1 0 0 0 0 0 0 1 a.png\n2 1 0 0 0 0 0 0 1 b.png\n");
  EXPECT_ERROR(read_colmap_images_text(path, kOneCamera), path, "line 2", "POINTS2D[]");
  EXPECT_ERROR(read_colmap_cameras_text(dir / "none.txt"), "none.txt", "read");
}

TEST(ColmapModel, PrefersTheTextModel) {
  const TempDir dir;
  dir.write("cameras.bin", bytes_of(uint64_t{1}) + pinhole(1));
  dir.write("images.bin", bytes_of(uint64_t{1}) + image(1, "binary.png") + points(2));
  const ColmapModel binary = read_colmap_model(dir.path());
  EXPECT_TRUE(binary.is_binary);
  ASSERT_EQ(binary.images.size(), 1u);
  EXPECT_EQ(binary.images[0].name, "binary.png");
  dir.write("cameras.txt", "1 PINHOLE 4 3 5 5 2 1.5\n");
  dir.write("images.txt", "1 1 0 0 0 0 0 0 1 text.png\n\n");
  const ColmapModel text = read_colmap_model(dir.path());
  EXPECT_FALSE(text.is_binary);
  EXPECT_EQ(text.images.at(0).name, "text.png");
}

}  // namespace
}  // namespace lf
