// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/focus_range.h"
#include "support/rigs.h"
#include "support/test.h"

namespace lf {
namespace focus_range_test {

Rig grid(int rows, int columns) { return test::camera_grid(rows, columns, 0.05, 160, 120, 150); }

// Random squares of 2 cm on two walls: z = 0.8 for x < 0, z = 2 for x > 0.
uint8_t wall(double x, double y) {
  const auto cell = [](double v) { return static_cast<uint32_t>(static_cast<int64_t>(std::floor(v / 0.02))); };
  uint32_t h = cell(x) * 2654435761u ^ cell(y) * 40503u * 65537u;
  h ^= h >> 15;
  h *= 2246822519u;
  h ^= h >> 13;
  return static_cast<uint8_t>(h % 256);
}
Image film(const Camera& camera, bool textured) {
  Image image(PixelFamily::kRgb, camera.width, camera.height);
  for (int y = 0; y < camera.height; y++)
    for (int x = 0; x < camera.width; x++) {
      const Vec2 ray = *camera.lens.unproject(Vec2(x, y));
      Vec3 p = camera.pose.position + 0.8 * Vec3(ray, 1);
      if (p.x > 0) p = camera.pose.position + 2.0 * Vec3(ray, 1);
      const uint8_t value = textured ? wall(p.x, p.y) : 90;
      std::fill_n(image.pixel(x, y), 3, value);
    }
  return image;
}

TEST(FocusRange, FindsTheNearAndTheFarWall) {
  const Rig rig = grid(3, 3);
  const auto images = [&](CameraIndex i) -> const Image& {
    static Image image;
    return image = film(rig.cameras[i], true);
  };
  const auto found = estimate_focus_range(rig, images).value();
  // Samples are whole pixels, and a pixel of disparity is 11 % of the near distance.
  EXPECT_NEAR(found.near, 0.8, 0.09);
  EXPECT_NEAR(found.far, 2.0, 0.2);
}

TEST(FocusRange, NothingWithoutTextureOrASecondPosition) {
  const auto grey = [](const Rig& rig) {
    return [&rig](CameraIndex i) -> const Image& {
      static Image image;
      return image = film(rig.cameras[i], false);
    };
  };
  const Rig nine = grid(3, 3), one = grid(1, 1);
  EXPECT_FALSE(estimate_focus_range(nine, grey(nine)));
  EXPECT_FALSE(estimate_focus_range(one, grey(one)));
}

}  // namespace focus_range_test
}  // namespace lf
