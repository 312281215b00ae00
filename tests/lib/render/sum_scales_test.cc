// SPDX-License-Identifier: LGPL-2.1-or-later
// Sums of views that see their cameras' pixels larger or smaller than the cameras do, turned in any way.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <vector>

#include <hwy/targets.h>

#include "lib/render/sum_arrays.h"
#include "lib/render/sum_errors.h"

namespace lf {
namespace {

// `LF_SCALES`: how many scales; each has a view of its own.
TEST(SumScales, AreAllWithinTheBound) {
  const char* const asked = std::getenv("LF_SCALES");
  const int scales = asked ? std::atoi(asked) : 300;
  constexpr double kLeast = 0.15, kLargest = 6;  // pixels of a camera from pixel to pixel of the view
  constexpr int kSide = 3, kWidth = 160, kHeight = 120;
  const std::vector<int64_t> targets = hwy::SupportedAndGeneratedTargets();
  double worst_level = 0, worst_chroma = 0;
  for (int n = 0; n < scales; n++) {
    hwy::SetSupportedTargetsForTest(targets[static_cast<size_t>(n) % targets.size()]);
    reference::Random random(n);
    const double scale = kLeast * std::pow(kLargest / kLeast, (n + random.uniform(0, 1)) / scales);
    const Rig rig = test::jittered_array(random, kSide, kWidth, kHeight, n % 5 ? 0 : -0.25);
    const double turn = n % 3 ? 0.02 * random.uniform(-1, 1) : std::numbers::pi * random.uniform(-1, 1);
    View view = test::view_into(rig, kSide, random.integer(60, 150), random.integer(40, 100),
                                Quat(std::cos(turn / 2), 0, 0, std::sin(turn / 2)) * random.small_rotation(0.05));
    view.lens = Lens::pinhole(1.25 * kWidth / scale, (view.width - 1) / 2.0, (view.height - 1) / 2.0);
    view.pose.position.z = random.uniform(-0.1, 0);
    if (n % 4 > 1) view.focus.map = test::depths(random, view, FocalMap::kFinestStep, n % 8 > 5);
    const auto images = images_of(rig, random, reference::smooth_image);
    for (const PixelFamily family : {PixelFamily::kI420, PixelFamily::kRgb})
      for (const Resampling resampling : {Resampling::kBilinear, Resampling::kCatmullRom}) {
        test::Worst worst;
        test::compare(rig, view, images, family, Coordinates::kGrid, worst, resampling);
        EXPECT_LE(std::max(worst.level, worst.chroma), 0.15)
            << "scale " << scale << ", view " << n << ", turned by " << turn << (view.focus.map ? ", map" : ", plane")
            << (family == PixelFamily::kI420 ? ", I420" : ", RGB")
            << (resampling == Resampling::kBilinear ? "" : ", cubic");
        EXPECT_LE(worst.lost, 1e-4) << "scale " << scale << ", view " << n;
        worst_level = std::max(worst_level, worst.level);
        worst_chroma = std::max(worst_chroma, worst.chroma);
      }
  }
  hwy::SetSupportedTargetsForTest(0);
  std::printf("%d scales: level error %.3f, chroma %.3f\n", scales, worst_level, worst_chroma);
}

}  // namespace
}  // namespace lf
