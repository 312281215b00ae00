// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/still.h"

#include <set>

#include <gtest/gtest.h>

#include "support/expect_error.h"

namespace lf {
namespace {

// A grid in the plane z = 0 looking along +z, pitch 0.1 m; every camera 32x24.
Rig grid(int rows, int columns) {
  Rig rig;
  for (int i = 0; i < rows * columns; i++) {
    Camera camera;
    camera.id = static_cast<uint32_t>(100 + i);
    camera.width = 32;
    camera.height = 24;
    camera.lens = Lens::pinhole(30, 15.5, 11.5);
    camera.pose.position = {0.1 * (i % columns), 0.1 * (i / columns), 0};
    rig.cameras.push_back(camera);
  }
  rig.topology = {Topology::Type::kGrid, rows, columns, {}};
  return rig;
}

// The view of a camera, moved by `by`, with the plane z = 2 in focus.
View view_like(const Camera& camera, const Vec3& by = {0, 0, 0}) {
  View view{camera.width, camera.height, camera.lens, camera.pose, {plane_through({0, 0, 2}, {0, 0, 1})}};
  view.pose.position += by;
  return view;
}

Image picture(int seed) {
  Image image(PixelFamily::kRgb, 32, 24);
  for (size_t i = 0; i < image.data().size(); i++) image.data()[i] = static_cast<uint8_t>((i * 37 + seed * 91) % 251);
  return image;
}

TEST(RenderStill, AViewAtACameraIsItsImage) {
  const Rig rig = grid(3, 3);
  const auto images = [](CameraIndex camera) -> const Image& {
    static Image image;
    return image = picture(static_cast<int>(camera));
  };
  const Still still = render_still(rig, build_mesh(rig), view_like(rig.cameras[4]), images);
  // Neighbours have weight 0 but for the rounding of the lines of sight.
  for (size_t i = 0; i < still.picture.data().size(); i++)
    ASSERT_NEAR(still.picture.data()[i], picture(4).data()[i], 1) << "at " << i;
  for (const float c : still.coverage) ASSERT_NEAR(c, 1, 1e-5);
}

TEST(RenderStill, AsksOnlyForCamerasThatContributeAndOnce) {
  const Rig rig = grid(4, 4);
  std::multiset<CameraIndex> asked;
  const auto images = [&](CameraIndex camera) -> const Image& {
    static Image image;
    asked.insert(camera);
    return image = picture(0);
  };
  View view = view_like(rig.cameras[0], {0.03, 0.03, 0});  // in the plane of the array: one face
  const Still still = render_still(rig, build_mesh(rig), view, images);
  EXPECT_EQ(asked, (std::multiset<CameraIndex>{0, 1, 4}));
  EXPECT_EQ(still.cameras, (std::vector<CameraIndex>{0, 1, 4}));
}

TEST(RenderStill, LostWeightIsNotCovered) {
  const Rig rig = grid(1, 1);
  const auto images = [](CameraIndex) -> const Image& {
    static const Image image = picture(1);
    return image;
  };
  // One pixel of the camera to the right at 2 m: the last column sees nothing of it.
  const Still still = render_still(rig, build_mesh(rig), view_like(rig.cameras[0], {2.0 / 30, 0, 0}), images,
                                   Resampling::kBilinear, {200, 0, 0});
  for (int y = 0; y < 24; y++) {
    EXPECT_NEAR(still.coverage[y * 32 + 30], 1, 1e-6);
    EXPECT_NEAR(still.coverage[y * 32 + 31], 0, 1e-4);
    EXPECT_EQ(still.picture.pixel(31, y)[0], 200);
  }
}

TEST(RenderStill, AViewThatSeesNothingIsBackground) {
  const Rig rig = grid(2, 2);
  const auto images = [](CameraIndex) -> const Image& { throw Error("must not be asked"); };
  View view = view_like(rig.cameras[0], {0, 0, 5});  // behind the focal plane, looking away from it
  const Still still = render_still(rig, build_mesh(rig), view, images, Resampling::kBilinear, {10, 20, 30});
  EXPECT_TRUE(still.cameras.empty());
  EXPECT_EQ(still.picture.pixel(5, 5)[2], 30);
  for (const float c : still.coverage) ASSERT_EQ(c, 0);
}

TEST(RenderStill, RefusesAMixtureOfFamilies) {
  const Rig rig = grid(1, 2);
  const auto images = [](CameraIndex camera) -> const Image& {
    static Image image;
    return image = camera == 0 ? picture(0) : to_i420(picture(1));
  };
  const View view = view_like(rig.cameras[0], {0.05, 0, 0});
  EXPECT_ERROR(render_still(rig, build_mesh(rig), view, images), "camera 101: another pixel family");
}

}  // namespace
}  // namespace lf
