// SPDX-License-Identifier: LGPL-2.1-or-later
// Stills beside the reference in 80-bit reals, in views that look past the cameras and past their images, too.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "composite/still.h"
#include "image/sharpen.h"
#include "lib/render/sum_arrays.h"
#include "reference/renderer.h"
#include "reference/subject_parts.h"
#include "render/detail.h"

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

struct Count {
  int64_t pixels = 0, off = 0;
  double worst = 0;
  void add(double error) {
    pixels++;
    off += error > 1;
    worst = std::max(worst, error);
  }
};

// Of 1000 pixels, whatever part of their cameras sees them, 999 are within one level of exact arithmetic in all
// channels. The others have less than 3/255 of their weight left, and show the background (composite/resolve.h).
TEST(RenderStill, IsWithinALevelOfExactArithmeticEvenWhereWeightIsLost) {
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420})
    for (const Resampling resampling : {Resampling::kBilinear, Resampling::kSharpened, Resampling::kCatmullRom}) {
      Count whole, part;  // pixels of whole coverage (or none), and ones of which some cameras lose their weight
      for (int n = 0; n < 24; n++) {
        Random random(n);
        const int side = 3 + n % 4;
        const Rig rig = test::jittered_array(random, side, 160, 120, n % 4 == 0 ? 0 : -0.2);
        const View view = view_of(random, rig, side, n);
        const Mesh mesh = build_mesh(rig);
        const bool i420 = family == PixelFamily::kI420;
        std::vector<Image> images, seen;
        for (const Camera& camera : rig.cameras) {
          Image rgb = reference::smooth_image(random, camera.width, camera.height);
          // As luma the red of it, whose rule is known.
          images.push_back(i420 ? reference::as_i420(rgb) : rgb);
          const bool sharp = resampling == Resampling::kSharpened && shows_detail(view, camera);
          seen.push_back(sharp ? sharpened(rgb) : std::move(rgb));
        }
        const Still still = render_still(
            rig, mesh, view, [&](CameraIndex i) -> const Image& { return images[i]; }, resampling);
        const reference::Picture exact = reference::render(
            rig, mesh, view, seen, resampling == Resampling::kCatmullRom ? resampling : Resampling::kBilinear);
        for (size_t i = 0; i < exact.pixels.size(); i++) {
          const reference::Pixel& pixel = exact.pixels[i];
          double error = 0;
          for (int c = 0; c < (i420 ? 1 : 3); c++) {
            const double value = still.picture.data().empty() ? 0 : still.picture.data()[i420 ? i : 3 * i + c];
            error = std::max(error, std::abs(value - pixel.colour[c]));
          }
          if (pixel.coverage > 3.1 / 255) {
            EXPECT_LE(error, 1);
          }
          (pixel.lost > 0 && pixel.coverage > 0 ? part : whole).add(error);
        }
      }
      const auto of = [](const Count& count) { return 100. * count.off / count.pixels; };
      std::printf(
          "%s, %s: %.4f %% of %ld pixels off by more than 1 (most %.2f); of %ld half-lost ones %.3f %% (%.1f)\n",
          family == PixelFamily::kRgb ? "RGB" : "I420",
          resampling == Resampling::kBilinear    ? "bilinear"
          : resampling == Resampling::kSharpened ? "sharpened"
                                                 : "catmull-rom",
          100. * (whole.off + part.off) / (whole.pixels + part.pixels), whole.pixels + part.pixels,
          std::max(whole.worst, part.worst), part.pixels, of(part), part.worst);
      EXPECT_GT(part.pixels, 15000);
      EXPECT_LE(100 * part.off, part.pixels);
      EXPECT_LE(1000 * (whole.off + part.off), whole.pixels + part.pixels);
    }
}

}  // namespace
}  // namespace lf
