// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/colmap_text.h"

#include <gtest/gtest.h>

#include "support/expect_error.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

const std::map<uint32_t, ColmapCamera> kOneCamera = {{1, {"PINHOLE", 4, 3, {5, 5, 2, 1.5}, 2}}};

TEST(ColmapText, ReadsCamerasOfEveryModel) {
  const TempDir dir;
  const auto cameras = read_colmap_cameras(dir.write("cameras.txt",
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

TEST(ColmapText, ReadsImagesWithAndWithoutPoints) {
  const TempDir dir;
  const auto images = read_colmap_images(dir.write("images.txt",
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
  EXPECT_EQ(images[1].q, Quat(1, 0, 0, 0)) << "normalised as COLMAP does it";
  EXPECT_EQ(images[1].t, Vec3(-1e-3, 0, 0));
  EXPECT_EQ(images[1].name, "left/b.png");
  EXPECT_EQ(images[2].name, "c");
}

TEST(ColmapText, RoundTripsToTheLastBit) {
  const TempDir dir;
  const std::map<uint32_t, ColmapCamera> cameras = {{3, {"SIMPLE_RADIAL", 4, 3, {1e3 / 7, 2, 1.5, -1e-17}, 1}}};
  ColmapImage image;
  image.id = 8;
  image.camera_id = 3;
  image.q = glm::normalize(Quat(0.1, -0.2, 0.3, 0.4));
  image.t = {1 / 3.0, -5e-324, 1.7976931348623157e308};
  image.name = "a b.png";
  const auto back = read_colmap_cameras(dir.write("cameras.txt", colmap_cameras_text(cameras)));
  EXPECT_EQ(back.at(3).params, cameras.at(3).params);
  EXPECT_EQ(back.at(3).model, "SIMPLE_RADIAL");
  const auto images = read_colmap_images(dir.write("images.txt", colmap_images_text({image})), cameras);
  ASSERT_EQ(images.size(), 1u);
  EXPECT_EQ(images[0].id, image.id);
  EXPECT_EQ(images[0].camera_id, image.camera_id);
  EXPECT_EQ(images[0].q, image.q);
  EXPECT_EQ(images[0].t, image.t);
  EXPECT_EQ(images[0].name, image.name);
}

TEST(ColmapText, ErrorsNameFileAndLine) {
  struct {
    const char* line;
    const char* message;
  } const cameras[] = {
      {"x PINHOLE 4 3 5 5 2 1.5", "CAMERA_ID must be an integer of 0 to 4294967295, is \"x\""},
      {"-1 PINHOLE 4 3 5 5 2 1.5", "CAMERA_ID must be an integer"},
      {"1", "MODEL is missing"},
      {"1 LENS 4 3 5 5 2 1.5", "unknown lens model \"LENS\""},
      {"1 PINHOLE 0 3 5 5 2 1.5", "WIDTH must be an integer of 1 to 16384, is \"0\""},
      {"1 PINHOLE 4 16385 5 5 2 1.5", "HEIGHT must be an integer of 1 to 16384, is \"16385\""},
      {"1 PINHOLE 4.5 3 5 5 2 1.5", "WIDTH must be an integer"},
      {"1 PINHOLE 4 3 5 5 2", "PINHOLE takes 4 numbers, has 3"},
      {"1 PINHOLE 4 3 5 5 2 1.5 0", "PINHOLE takes 4 numbers, has 5"},
      {"1 PINHOLE 4 3 5 five 2 1.5", "PARAMS[] must be a finite number, is \"five\""},
      {"1 PINHOLE 4 3 nan 5 2 1.5", "PARAMS[] must be a finite number, is \"nan\""},
      {"1 PINHOLE 4 3 1e999 5 2 1.5", "PARAMS[] must be a finite number, is \"1e999\""},
      {"2 PINHOLE 4 3 5 5 2 1.5", "CAMERA_ID 2 is there twice"},
  };
  const TempDir dir;
  for (const auto& c : cameras) {
    const std::string path = dir.write("cameras.txt", std::string("#\n2 PINHOLE 4 3 5 5 2 1.5\n") + c.line + "\n");
    EXPECT_ERROR(read_colmap_cameras(path), path + ": line 3: " + c.message);
  }
  struct {
    const char* line;
    const char* message;
  } const images[] = {
      {"1 1 0 0 0 0 0 0 1", "NAME is missing"},
      {"1 1 0 0 0 0 0 0 1 caf\xe9.png", "NAME is no text in UTF-8"},
      {"1 1 0 0 0 0 0", "TZ is missing"},
      {"1 0 0 0 0 0 0 0 1 a.png", "QW, QX, QY, QZ must be a rotation"},
      {"1 1 0 inf 0 0 0 0 1 a.png", "QY must be a finite number, is \"inf\""},
      {"1 1 0 0 0 0 0 0 7 a.png", "CAMERA_ID 7 is not in cameras.txt"},
      {"2 1 0 0 0 0 0 0 1 a.png", "IMAGE_ID 2 is there twice"},
  };
  for (const auto& c : images) {
    const std::string path = dir.write("images.txt", std::string("2 1 0 0 0 0 0 0 1 z.png\n\n") + c.line + "\n");
    EXPECT_ERROR(read_colmap_images(path, kOneCamera), path + ": line 3: " + c.message);
  }
  // Without the lines of points every second image would be taken for points.
  const std::string path = dir.write("images.txt", "1 1 0 0 0 0 0 0 1 a.png\n2 1 0 0 0 0 0 0 1 b.png\n");
  EXPECT_ERROR(read_colmap_images(path, kOneCamera), path + ": line 2: POINTS2D[]");
  EXPECT_ERROR(read_colmap_cameras(dir / "none.txt"), "none.txt: can't be read");
}

}  // namespace
}  // namespace lf
