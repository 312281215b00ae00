// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/epipolar.h"

#include "scene/scene.h"
#include "support/expect_error.h"
#include "support/photographs.h"
#include "support/test.h"

namespace lf {
namespace {

std::vector<Image> waves(const Rig& rig, double depth, double length) {
  std::vector<Image> images;
  for (const Camera& camera : rig.cameras) {
    Image image(PixelFamily::kRgb, camera.width, camera.height);
    for (int y = 0; y < camera.height; y++)
      for (int x = 0; x < camera.width; x++) {
        const double world = camera.pose.position.x + depth * (x - camera.lens.cx()) / camera.lens.fx();
        for (int c = 0; c < 3; c++)
          image.pixel(x, y)[c] = static_cast<uint8_t>(std::lround(127.5 + 120 * std::sin(2 * M_PI * world / length)));
      }
    images.push_back(image);
  }
  return images;
}

CameraImages of(const std::vector<Image>& images) {
  return [&images](CameraIndex camera) -> const Image& { return images[camera]; };
}

// Returns the column with phase 0 of a row's wave, in pixels, from the first harmonic.
double phase(const Image& picture, int y, double pixels) {
  double a = 0, b = 0;
  const int whole = static_cast<int>(std::floor(picture.width() / pixels) * pixels);
  for (int x = 0; x < whole; x++) {
    a += picture.pixel(x, y)[1] * std::cos(2 * M_PI * x / pixels);
    b += picture.pixel(x, y)[1] * std::sin(2 * M_PI * x / pixels);
  }
  return std::atan2(b, a) / (2 * M_PI) * pixels;
}

TEST(EpipolarImage, SlopeDependsOnTheDepth) {
  const Rig rig = make_grid_rig({.rows = 1, .columns = 6, .pitch = 0.02, .fov_y_deg = 40, .width = 200, .height = 60});
  const std::vector<CameraIndex> line = row_of_cameras(rig, 0);
  const double f = rig.cameras[0].lens.fx();
  constexpr double kFocus = 2;
  for (const double depth : {1.4, 2.0, 3.5}) {
    const double length = 25 * depth / f;  // 25 pixels of a camera's image
    const std::vector<Image> images = waves(rig, depth, length);
    const Image epi = epipolar_image(rig, line, of(images), {.distance = kFocus, .width = 100, .height = 60});
    // A point at `depth` moves by f b (1 / focus - 1 / depth) pixels from one camera to the next.
    const double step = f * 0.02 * (1 / kFocus - 1 / depth);
    const double moved = phase(epi, 35, 25) - phase(epi, 25, 25);  // cameras 3 and 2
    EXPECT_NEAR(std::remainder(moved - step, 25), 0, 0.05) << depth;
  }
}

TEST(EpipolarImage, RowsShowOneLineOfEachCamera) {
  Rig rig = scene_rig(3, 4, 96, 72);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> off(-0.004, 0.004), degrees(-2, 2);
  for (Camera& camera : rig.cameras) {
    camera.pose.position += Vec3(off(random), off(random), off(random));
    camera.pose.orientation = quat_from_euler({degrees(random), degrees(random), degrees(random)});
  }
  const std::vector<Image> images = test::scene_images(rig);
  for (const bool is_row : {true, false}) {
    const std::vector<CameraIndex> line = is_row ? row_of_cameras(rig, 1) : column_of_cameras(rig, 2);
    const int width = 120, stripe = 3, height = stripe * static_cast<int>(line.size());
    const double distance = 2.2, across = 0.07;
    const Image epi = epipolar_image(rig, line, of(images), {distance, across, width, height});

    const Vec3 a = rig.cameras[line.front()].pose.position, b = rig.cameras[line.back()].pose.position;
    const Vec3 u = (b - a) / glm::length(b - a);
    Vec3 ahead(0);
    for (const CameraIndex i : line) ahead += rig.cameras[i].pose.forward();
    ahead -= glm::dot(ahead, u) * u;
    ahead /= glm::length(ahead);
    const Vec3 aside = is_row ? glm::cross(ahead, u) : -glm::cross(ahead, u);
    EXPECT_GT(is_row ? aside.y : aside.x, 0.9);
    int compared = 0, dark = 0;
    for (size_t k = 0; k < line.size(); k++) {
      const Camera& camera = rig.cameras[line[k]];
      const int y = static_cast<int>(k) * stripe + 1;  // the centre of its stripe, regardless of position errors
      for (int x = 0; x < width; x++) {
        const double along = (x - (width - 1) / 2.0) * distance / rig.cameras[line[line.size() / 2]].lens.fx();
        const Vec3 at = camera.pose.camera_from_world((a + b) / 2.0 + distance * ahead + across * aside + along * u);
        const Vec2 pixel = *camera.lens.project(at);
        const uint8_t* seen = epi.pixel(x, y);
        if (pixel.x < 0 || pixel.y < 0 || pixel.x > camera.width - 1 || pixel.y > camera.height - 1) {
          dark += seen[0] + seen[1] + seen[2] == 0;
          continue;
        }
        const int left = std::min(static_cast<int>(pixel.x), camera.width - 2);
        const int top = std::min(static_cast<int>(pixel.y), camera.height - 2);
        const double s = pixel.x - left, t = pixel.y - top;
        for (int c = 0; c < 3; c++) {
          const auto v = [&](int i, int j) { return double{images[line[k]].pixel(left + i, top + j)[c] * 1.0}; };
          const double want = (1 - t) * ((1 - s) * v(0, 0) + s * v(1, 0)) + t * ((1 - s) * v(0, 1) + s * v(1, 1));
          ASSERT_NEAR(seen[c], want, 0.51) << "camera " << k << ", column " << x;
        }
        compared++;
      }
    }
    EXPECT_GT(compared, 200);
    EXPECT_GT(dark, 20) << "invisible pixels are black";
  }
}

TEST(EpipolarImage, RowsAreProportionalToThePositions) {
  Rig rig = make_grid_rig({.rows = 1, .columns = 3, .pitch = 0.1, .fov_y_deg = 40, .width = 40, .height = 30});
  rig.cameras[1].pose.position.x = -0.08;
  std::vector<Image> images;
  for (int i = 0; i < 3; i++) {
    images.emplace_back(PixelFamily::kRgb, 40, 30);
    for (uint8_t& v : images.back().data()) v = static_cast<uint8_t>(50 + 50 * i);
  }
  const Image epi = epipolar_image(rig, row_of_cameras(rig, 0), of(images), {.distance = 4, .width = 1, .height = 300});
  std::array<int, 3> rows{};
  for (int y = 0; y < 300; y++) rows[(epi.pixel(0, y)[0] - 50) / 50]++;
  EXPECT_EQ(rows[0], 60) << "half a pitch before it, and half-way to the next";
  EXPECT_EQ(rows[1], 100);
  EXPECT_EQ(rows[2], 140);
}

TEST(EpipolarImage, RefusesInvalidOptions) {
  Rig rig = make_grid_rig({.rows = 2, .columns = 3, .pitch = 0.1, .fov_y_deg = 40, .width = 40, .height = 30});
  const std::vector<Image> images(6, Image(PixelFamily::kRgb, 40, 30)), small(6, Image(PixelFamily::kRgb, 20, 30));
  const std::vector<CameraIndex> line = row_of_cameras(rig, 1);
  EXPECT_EQ(line, (std::vector<CameraIndex>{3, 4, 5}));
  EXPECT_EQ(column_of_cameras(rig, 2), (std::vector<CameraIndex>{2, 5}));
  EXPECT_ERROR(row_of_cameras(rig, 2), "row 2", "0 to 1");
  EXPECT_ERROR(column_of_cameras(rig, -1), "column -1", "0 to 2");
  const EpipolarOptions good{.distance = 2, .width = 20, .height = 30};
  EXPECT_ERROR(epipolar_image(rig, line, of(images), {.distance = 0, .width = 20, .height = 30}), "distance",
               "positive");
  EXPECT_ERROR(epipolar_image(rig, line, of(images), {.distance = 2, .width = 0, .height = 30}), "width");
  EXPECT_ERROR(epipolar_image(rig, {3}, of(images), good), "two cameras");
  EXPECT_ERROR(epipolar_image(rig, {3, 3}, of(images), good), "different places");
  EXPECT_ERROR(epipolar_image(rig, line, of(small), good), "sizes");
  for (Camera& camera : rig.cameras) camera.pose.orientation = quat_from_euler({90, 0, 0});
  EXPECT_ERROR(epipolar_image(rig, line, of(images), good), "along their line");
  rig.topology = {};
  EXPECT_ERROR(row_of_cameras(rig, 0), "rig", "grid");
}

}  // namespace
}  // namespace lf
