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

using reference::Random;

class SumScales : public testing::Test {
 protected:
  void TearDown() override {
    hwy::SetSupportedTargetsForTest(0);
    std::printf("level error %.3f, chroma %.3f\n", worst_.level, worst_.chroma);
  }
  // A view of its own for each number n. `scale`: pixels of a camera from pixel to pixel; `turn`: of the view, radians.
  void check(int n, Random& random, double scale, double turn, bool mapped) {
    hwy::SetSupportedTargetsForTest(targets_[static_cast<size_t>(n) % targets_.size()]);
    const Rig rig = test::jittered_array(random, kSide, kWidth, kHeight, n % 5 ? 0 : -0.25);
    View view = test::view_into(rig, kSide, random.integer(60, 150), random.integer(40, 100),
                                Quat(std::cos(turn / 2), 0, 0, std::sin(turn / 2)) * random.small_rotation(0.05));
    view.lens = Lens::pinhole(1.25 * kWidth / scale, (view.width - 1) / 2.0, (view.height - 1) / 2.0);
    view.pose.position.z = random.uniform(-0.1, 0);
    if (mapped) view.focus.map = test::depths(random, view, FocalMap::kFinestStep, n % 8 > 5);
    const auto images = images_of(rig, random, reference::smooth_image);
    for (const PixelFamily family : {PixelFamily::kI420, PixelFamily::kRgb}) {
      test::Worst worst;
      test::compare(rig, view, images, family, Coordinates::kGrid, worst);
      EXPECT_LE(std::max(worst.level, worst.chroma), 0.15)
          << "scale " << scale << ", view " << n << ", turned by " << turn << (mapped ? ", map" : ", plane")
          << (family == PixelFamily::kI420 ? ", I420" : ", RGB");
      EXPECT_LE(worst.lost, 1e-4) << "scale " << scale << ", view " << n;
      worst_.level = std::max(worst_.level, worst.level);
      worst_.chroma = std::max(worst_.chroma, worst.chroma);
    }
  }

 private:
  static constexpr int kSide = 3, kWidth = 160, kHeight = 120;
  const std::vector<int64_t> targets_ = hwy::SupportedAndGeneratedTargets();
  test::Worst worst_;
};

// `LF_SCALES`: how many scales.
TEST_F(SumScales, AreAllWithinTheBound) {
  const char* const asked = std::getenv("LF_SCALES");
  const int scales = asked ? std::atoi(asked) : 250;
  constexpr double kLeast = 0.15, kLargest = 6;
  for (int n = 0; n < scales; n++) {
    Random random(n);
    const double scale = kLeast * std::pow(kLargest / kLeast, (n + random.uniform(0, 1)) / scales);
    check(n, random, scale, (n % 3 ? 0.02 : std::numbers::pi) * random.uniform(-1, 1), n % 4 > 1);
  }
}

// At the end of what 16 bits hold of a block's width.
TEST_F(SumScales, TwoPixelsForOneAre) {
  for (int n = 0; n < 40; n++) {
    Random random(n);
    check(n, random, random.uniform(1.9, 2.1), 0, false);
  }
}

}  // namespace
}  // namespace lf
