// SPDX-License-Identifier: LGPL-2.1-or-later
// Stills beside the reference in 80-bit reals, in views that look past the cameras and past their images, too.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "composite/still.h"
#include "image/correction.h"
#include "lib/render/sum_arrays.h"
#include "reference/renderer.h"
#include "reference/subject_parts.h"
#include "render/camera_projection.h"

namespace lf {
namespace {

using reference::Random;

// From anywhere about the array, a plane or a focal map in focus; every other view looks over the array's edge.
View view_of(Random& random, const Rig& rig, int side, int n) {
  View view = test::view_into(rig, side, 150, 110, random.small_rotation(0.1));
  const double reach = 0.1 * side / 2 * (n % 2 ? 1.5 : 0.6), middle = 0.1 * (side - 1) / 2;
  const double x = random.uniform(-reach, reach), y = random.uniform(-reach, reach);
  view.pose.position = {middle + x, middle + y, random.uniform(-0.5, 0.3)};
  view.lens = Lens::from_fov_y(random.uniform(20, 50), view.width, view.height);
  if (n % 3 == 0) view.focus.map = test::depths(random, view, 8, false);
  return view;
}

// Pixels in which the largest error of a channel is above 1.
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
  Count part;  // of which some cameras lose their weight
  Count left;  // with more than 3/255 of their weight left: others show the background (composite/resolve.h)
};

void measure(int n, PixelFamily family, Resampling resampling, Image (*make)(Random&, int, int), Counts& counts) {
  Random random(n);
  const int side = 3 + n % 4;
  const Rig rig = test::jittered_array(random, side, 160, 120, n % 4 == 0 ? 0 : -0.2);
  const View view = view_of(random, rig, side, n);
  const Mesh mesh = build_mesh(rig);
  const bool i420 = family == PixelFamily::kI420;
  std::vector<Image> images, seen;
  for (const Camera& camera : rig.cameras) {
    Image rgb = make(random, camera.width, camera.height);
    images.push_back(i420 ? reference::as_i420(rgb) : rgb);  // as luma the red of it, whose rule is known
    const bool sharp = resampling == Resampling::kSharpened && shows_detail(view, camera);
    seen.push_back(sharp ? sharpened(rgb) : std::move(rgb));
  }
  const Still still = render_still(
      rig, mesh, view, [&](CameraIndex i) -> const Image& { return images[i]; }, resampling);
  if (still.cameras.empty()) return;  // nothing to be seen: black
  const reference::Picture exact = reference::render(rig, mesh, view, seen);
  for (size_t i = 0; i < exact.pixels.size(); i++) {
    const reference::Pixel& pixel = exact.pixels[i];
    double error = 0;
    for (int c = 0; c < (i420 ? 1 : 3); c++)
      error = std::max(error, std::abs(still.picture.data()[i420 ? i : 3 * i + c] - pixel.colour[c]));
    counts.all.add(error);
    if (pixel.lost > 0 && pixel.coverage > 0) counts.part.add(error);
    if (pixel.coverage > 3.1 / 255) counts.left.add(error);
  }
}

void print(const char* what, PixelFamily family, Resampling resampling, const Counts& counts) {
  std::printf(
      "%s, %s, %s: %.4f %% of %ld pixels off by more than 1; of %ld half-lost ones %.3f %%; most with weight %.2f\n",
      what, family == PixelFamily::kRgb ? "RGB" : "I420",
      resampling == Resampling::kBilinear ? "bilinear" : "sharpened", 100. * counts.all.off / counts.all.pixels,
      counts.all.pixels, counts.part.pixels, 100. * counts.part.off / counts.part.pixels, counts.left.worst);
}

// Of 1000 pixels, whatever part of their cameras sees them, 999 are within one level of exact arithmetic in all
// channels.
TEST(RenderStill, IsWithinALevelOfExactArithmeticEvenWhereWeightIsLost) {
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420})
    for (const Resampling resampling : {Resampling::kBilinear, Resampling::kSharpened}) {
      Counts counts;
      for (int n = 0; n < 24; n++) measure(n, family, resampling, reference::smooth_image, counts);
      print("smooth", family, resampling, counts);
      EXPECT_GT(counts.part.pixels, 15000);
      EXPECT_LE(100 * counts.part.off, counts.part.pixels);
      EXPECT_LE(1000 * counts.all.off, counts.all.pixels);
      EXPECT_LE(counts.left.worst, 1);
    }
}

// As well where no pixel of the cameras is like the next.
TEST(RenderStill, IsWithinALevelOfExactArithmeticInNoise) {
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420}) {
    Counts counts;
    for (int n = 0; n < 24; n++) measure(n, family, Resampling::kBilinear, reference::noise_image, counts);
    print("noise", family, Resampling::kBilinear, counts);
    EXPECT_GT(counts.part.pixels, 15000);
    EXPECT_LE(1000 * counts.all.off, counts.all.pixels);
  }
}

}  // namespace
}  // namespace lf
