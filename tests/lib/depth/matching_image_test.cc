// SPDX-License-Identifier: LGPL-2.1-or-later
#include "depth/matching_image.h"

#include "reference/generators.h"
#include "support/test.h"

namespace lf {
namespace {

using reference::Random;

Camera camera_of(int width, int height, const Lens& lens, const Pose& pose = {}) {
  return reference::make_camera(0, width, height, lens, pose);
}

TEST(MatchingImage, AveragesPixelsAndHasTheirDifferences) {
  Random random(1);
  const Camera camera = camera_of(21, 16, Lens::pinhole(30, 9.7, 8.1));
  Image image(PixelFamily::kI420, camera.width, camera.height);
  for (uint8_t& value : image.data()) value = static_cast<uint8_t>(random.integer(0, 255));
  const auto luma = [&](int x, int y) {
    double sum = 0;
    for (int j = 0; j < 2; j++)
      for (int i = 0; i < 2; i++) sum += image.plane(0)[(2 * y + j) * camera.width + 2 * x + i];
    return sum / 4;
  };
  const MatchingImage half = matching_image(camera, image.view(), 2);
  ASSERT_EQ(half.width, 10);
  ASSERT_EQ(half.height, 8);
  for (int y = 1; y < 7; y++)
    for (int x = 1; x < 9; x++) {
      const MatchingImage::Pixel& pixel = half.pixels[static_cast<size_t>(y) * half.width + x];
      EXPECT_NEAR(pixel[0], MatchingImage::kUnit * luma(x, y), 1);
      EXPECT_NEAR(pixel[1], MatchingImage::kUnit * (luma(x + 1, y) - luma(x - 1, y)) / 2, 1);
      EXPECT_NEAR(pixel[2], MatchingImage::kUnit * (luma(x, y + 1) - luma(x, y - 1)) / 2, 1);
      EXPECT_EQ(pixel[3], 0);
    }
}

TEST(MatchingImage, HasTheLumaOfAnRgbImage) {
  const Camera camera = camera_of(4, 4, Lens::pinhole(4, 1.5, 1.5));
  Image image(PixelFamily::kRgb, 4, 4);
  for (int i = 0; i < 16; i++) {
    image.data()[3 * i] = 10;
    image.data()[3 * i + 1] = 200;
    image.data()[3 * i + 2] = 90;
  }
  EXPECT_NEAR(matching_image(camera, image.view(), 1).pixels[5][0],
              MatchingImage::kUnit * (0.299 * 10 + 0.587 * 200 + 0.114 * 90), 1);
}

// The luma of the image is a function of the line of sight, so it must be the same in the undistorted image.
TEST(MatchingImage, RemovesLensDistortion) {
  const Lens lens(LensModel::kOpenCv, {150, 160, 78, 61, -0.2, 0.05, 0.003, -0.002});
  const Camera camera = camera_of(160, 120, lens);
  const auto luma_of = [](const Vec2& ray) { return 128 + 90 * ray.x + 60 * ray.y; };
  Image image(PixelFamily::kI420, camera.width, camera.height);
  for (int y = 0; y < camera.height; y++)
    for (int x = 0; x < camera.width; x++)
      image.plane(0)[y * camera.width + x] = static_cast<uint8_t>(std::lround(luma_of(*lens.unproject({x, y}))));
  const MatchingImage half = matching_image(camera, image.view(), 2);
  int seen = 0;
  for (int y = 0; y < half.height; y++)
    for (int x = 0; x < half.width; x++) {
      const MatchingImage::Pixel& pixel = half.pixels[static_cast<size_t>(y) * half.width + x];
      const Vec3 ray = half.ray(x, y);
      if (pixel[3] != 0) {
        EXPECT_EQ(pixel[3], MatchingImage::kUnseen);
        continue;
      }
      seen++;
      EXPECT_NEAR(pixel[0] / static_cast<double>(MatchingImage::kUnit), luma_of({ray.x, ray.y}), 0.6) << x << ", " << y;
    }
  EXPECT_GT(seen, half.width * half.height * 8 / 10);
  EXPECT_LT(seen, half.width * half.height) << "the corners of the pinhole image are outside of the camera's image";
}

TEST(PixelMapping, ProjectsPointsAsTheCamerasDo) {
  for (int seed = 0; seed < 50; seed++) {
    Random random(seed);
    MatchingImage from, to;
    for (MatchingImage* image : {&from, &to}) {
      image->focal = random.uniform(50, 500);
      image->centre = {random.uniform(0, 300), random.uniform(0, 300)};
      image->pose = Pose(random.point_in_box(1), random.small_rotation(0.5));
    }
    const PixelMapping map(from, to);
    for (int i = 0; i < 20; i++) {
      const double x = random.uniform(0, 300), y = random.uniform(0, 300), inverse = random.uniform(0.01, 0.8);
      const Vec3 at = from.pose.position + from.pose.rotation() * (from.ray(x, y) / inverse);
      const Vec3 in_other = glm::transpose(to.pose.rotation()) * (at - to.pose.position);
      const std::array<float, 3> far = map.at(static_cast<float>(x), static_cast<float>(y));
      const auto coordinate = [&](int k) { return far[k] + static_cast<float>(inverse) * map.parallax[k]; };
      if (in_other.z * inverse < 0.1) continue;
      EXPECT_NEAR(coordinate(2), in_other.z * inverse, 1e-5);
      EXPECT_NEAR(coordinate(0) / coordinate(2), to.focal * in_other.x / in_other.z + to.centre.x, 0.02);
      EXPECT_NEAR(coordinate(1) / coordinate(2), to.focal * in_other.y / in_other.z + to.centre.y, 0.02);
    }
  }
}

}  // namespace
}  // namespace lf
