// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/still.h"
#include "image/image_filters.h"
#include "lib/render/sum_arrays.h"
#include "reference/numerics.h"
#include "reference/renderer.h"
#include "render/camera_projection.h"
#include "support/expect_error.h"
#include "support/rigs.h"
#include "support/test.h"

namespace lf {
namespace {

Rig grid(int rows, int columns) { return test::camera_grid(rows, columns, 0.1, 32, 24, 30, 100); }

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

TEST(RenderStill, ViewAtACameraIsItsImage) {
  const Rig rig = grid(3, 3);
  const auto images = [](CameraIndex camera) -> const Image& {
    static Image image;
    return image = picture(static_cast<int>(camera));
  };
  const Still still = render_still(rig, build_mesh(rig), view_like(rig.cameras[4]), images);
  // Neighbours have weight 0 except for rounding of the lines of sight.
  for (size_t i = 0; i < still.picture.data().size(); i++)
    ASSERT_NEAR(still.picture.data()[i], picture(4).data()[i], 1) << "at " << i;
  for (const float c : still.coverage) ASSERT_NEAR(c, 1, 1e-5);
}

TEST(RenderStill, LoadsContributingCamerasOnce) {
  const Rig rig = grid(4, 4);
  std::multiset<CameraIndex> asked;
  const auto images = [&](CameraIndex camera) -> const Image& {
    static Image image;
    asked.insert(camera);
    return image = picture(0);
  };
  View view = view_like(rig.cameras[0], {0.03, 0.03, 0});
  const Still still = render_still(rig, build_mesh(rig), view, images);
  EXPECT_EQ(asked, (std::multiset<CameraIndex>{0, 1, 4}));
  EXPECT_EQ(still.cameras, (std::vector<CameraIndex>{0, 1, 4}));
}

TEST(RenderStill, MissingWeightReducesTheCoverage) {
  const Rig rig = grid(1, 1);
  const auto images = [](CameraIndex) -> const Image& {
    static const Image image = picture(1);
    return image;
  };
  // One pixel of the camera to the right at 2 m: the camera does not see the last column.
  const Still still = render_still(rig, build_mesh(rig), view_like(rig.cameras[0], {2.0 / 30, 0, 0}), images,
                                   Resampling::kBilinear, {200, 0, 0});
  for (int y = 0; y < 24; y++) {
    EXPECT_NEAR(still.coverage[y * 32 + 30], 1, 1e-6);
    EXPECT_NEAR(still.coverage[y * 32 + 31], 0, 1e-4);
    EXPECT_EQ(still.picture.pixel(31, y)[0], 200);
  }
}

TEST(RenderStill, EmptyViewShowsTheBackground) {
  const Rig rig = grid(2, 2);
  const auto images = [](CameraIndex) -> const Image& { throw Error("must not be asked"); };
  View view = view_like(rig.cameras[0], {0, 0, 5});  // the viewpoint is beyond the focal plane and faces away
  const Still still = render_still(rig, build_mesh(rig), view, images, Resampling::kBilinear, {10, 20, 30});
  EXPECT_TRUE(still.cameras.empty());
  EXPECT_EQ(still.picture.pixel(5, 5)[2], 30);
  for (const float c : still.coverage) ASSERT_EQ(c, 0);
}

TEST(RenderStill, RefusesMixedFamilies) {
  const Rig rig = grid(1, 2);
  const auto images = [](CameraIndex camera) -> const Image& {
    static Image image;
    return image = camera == 0 ? picture(0) : to_i420(picture(1));
  };
  const View view = view_like(rig.cameras[0], {0.05, 0, 0});
  EXPECT_ERROR(render_still(rig, build_mesh(rig), view, images), "camera 101", "pixel family");
}

using reference::Random;

// The viewpoint is anywhere near the array, the focus a plane or a map; every second view looks over the array's edge.
View view_of(Random& random, int side, int n) {
  View view = test::view_into(side, 150, 110, random.small_rotation(0.1));
  const double reach = 0.1 * side / 2 * (n % 2 ? 1.5 : 0.6), middle = 0.1 * (side - 1) / 2;
  const double x = random.uniform(-reach, reach), y = random.uniform(-reach, reach);
  view.pose.position = {middle + x, middle + y, random.uniform(-0.5, 0.3)};
  view.lens = Lens::from_fov_y(random.uniform(20, 50), view.width, view.height);
  if (n % 3 == 0) view.focus.map = test::depths(random, view, 8, false);
  return view;
}

struct Count {
  int64_t pixels = 0, off = 0;
  double worst = 0;
  void add(double error) {
    pixels++;
    off += error > 1;
    worst = std::max(worst, error);
  }
};
struct Counts {
  Count all;
  Count part;  // pixels with some missing weight
  Count left;  // at least 3/255 of the weight left; pixels with less show the background (composite/resolve.h)
};

// Compares pictures in both families, of the same images, with the exact picture.
void measure(int n, Resampling resampling, Image (*make)(Random&, int, int), std::map<PixelFamily, Counts>& counts) {
  Random random(n);
  const int side = 3 + n % 4;
  const Rig rig = test::jittered_array(random, side, 160, 120, n % 4 == 0 ? 0 : -0.2);
  View view = view_of(random, side, n);
  view.blending.extrapolates = false;  // the reference renders only the mesh
  const Mesh mesh = build_mesh(rig);
  std::vector<Image> rgb, i420, seen;
  for (const Camera& camera : rig.cameras) {
    rgb.push_back(make(random, camera.width, camera.height));
    i420.push_back(reference::as_i420(rgb.back()));  // luma is the red channel, with a known conversion
    const bool sharp = resampling == Resampling::kSharpened && shows_detail(view, camera);
    seen.push_back(sharp ? sharpened(rgb.back()) : rgb.back());
  }
  const reference::Picture exact = reference::render(rig, mesh, view, seen);
  for (const std::vector<Image>& images : {std::cref(rgb), std::cref(i420)}) {
    const Still still = render_still(
        rig, mesh, view, [&](CameraIndex i) -> const Image& { return images[i]; }, resampling);
    if (still.cameras.empty()) return;
    const size_t channels = &images == &rgb ? 3 : 1;
    Counts& count = counts[images[0].family()];
    for (size_t i = 0; i < exact.pixels.size(); i++) {
      const reference::Pixel& pixel = exact.pixels[i];
      double error = 0;
      for (size_t c = 0; c < channels; c++)
        error = std::max(error, std::abs(still.picture.data()[channels * i + c] - pixel.colour[c]));
      count.all.add(error);
      if (pixel.lost > 0 && pixel.coverage > 0) count.part.add(error);
      if (pixel.coverage > 3.1 / 255) count.left.add(error);
    }
  }
}

void print(const char* what, PixelFamily family, Resampling resampling, const Counts& counts) {
  std::printf(
      "%s, %s, %s: %.4f %% of %ld pixels off by more than 1; of %ld half-lost ones %.3f %%; most with weight %.2f\n",
      what, family == PixelFamily::kRgb ? "RGB" : "I420",
      resampling == Resampling::kBilinear ? "bilinear" : "sharpened", 100. * counts.all.off / counts.all.pixels,
      counts.all.pixels, counts.part.pixels, 100. * counts.part.off / counts.part.pixels, counts.left.worst);
}

// 999 of 1000 pixels are within one level of exact arithmetic in all channels, with any part of their cameras missing.
TEST(RenderStill, IsExactToALevelWithMissingWeight) {
  for (const Resampling resampling : {Resampling::kBilinear, Resampling::kSharpened}) {
    std::map<PixelFamily, Counts> of_family;
    for (int n = 0; n < 24; n++) measure(n, resampling, reference::smooth_image, of_family);
    ASSERT_EQ(of_family.size(), 2u);
    for (const auto& [family, counts] : of_family) {
      print("smooth", family, resampling, counts);
      EXPECT_GT(counts.part.pixels, 15000);
      EXPECT_LE(100 * counts.part.off, counts.part.pixels);
      EXPECT_LE(1000 * counts.all.off, counts.all.pixels);
      EXPECT_LE(counts.left.worst, 1);
    }
  }
}

TEST(RenderStill, IsExactToALevelInNoise) {
  std::map<PixelFamily, Counts> of_family;
  for (int n = 0; n < 24; n++) measure(n, Resampling::kBilinear, reference::noise_image, of_family);
  ASSERT_EQ(of_family.size(), 2u);
  for (const auto& [family, counts] : of_family) {
    print("noise", family, Resampling::kBilinear, counts);
    EXPECT_GT(counts.part.pixels, 15000);
    EXPECT_LE(1000 * counts.all.off, counts.all.pixels);
  }
}

}  // namespace
}  // namespace lf
