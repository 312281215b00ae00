// SPDX-License-Identifier: LGPL-2.1-or-later
// The production path (8-bit fragments, compositor) on rendered data with known truth, beside the reference.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "image/image.h"
#include "lib/render/production.h"
#include "quality/quality.h"
#include "reference/renderer.h"
#include "rig/rig_json.h"
#include "view/views_json.h"

namespace lf {
namespace {

// How far 8-bit fragments may be from the reference in a pixel: each valid sample is rounded (0.5), and so is each lost
// weight; the division by the weight that is left enlarges both; the two pictures are rounded (1). Where all weight is
// valid that is 1: three rounded samples add up to an integer that is less than 1.5 from their exact sum.
double rounding_bound(const reference::Pixel& pixel, double colour) {
  int valid = 0, lost = 0;
  for (int k = 0; k < pixel.corners; k++) (pixel.valid[k] > 0 ? valid : lost) += pixel.weight[k] > 0;
  if (lost == 0) return 1;
  const double left = pixel.coverage - 0.5 * lost / 255;
  return (0.5 * valid + colour * 0.5 * lost / 255) / left + 1;
}
constexpr double kLeastCompared = 0.05;  // valid weight

class Chess : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = test::data_folder("chess");
    if (folder_.empty()) GTEST_SKIP() << "../shared/data/chess is absent";
    rig_ = load_rig(folder_ + "/rig.json");
    views_ = load_views(folder_ + "/views.json");
    mesh_ = build_mesh(rig_);
    images_ = test::load_images(rig_);
  }
  std::string folder_;
  Rig rig_;
  std::vector<NamedView> views_;
  Mesh mesh_;
  std::vector<Image> images_;
};

TEST_F(Chess, EveryViewIsAsGoodAsTheReference) {
  const std::vector<Image> i420 = test::i420_of(images_);
  std::printf(
      "PSNR against truth and coverage as in quality.h; +-1: pixels with coverage > 0.999, +-1 (all): all pixels\n");
  std::printf("%-8s %8s | %9s | %8s %9s %9s | %8s %9s\n", "view", "coverage", "reference", "RGB", "+-1", "+-1 (all)",
              "I420", "luma +-2");
  for (const NamedView& view : views_) {
    const reference::Picture expected = reference::render(rig_, mesh_, view.view, images_);
    const Image reference_image = expected.image(), truth = load_image(folder_ + "/truth/" + view.name + ".png");
    const std::vector<float> coverage = expected.coverage();
    const test::Production production(rig_, mesh_, view.view);
    const Image rgb = production.picture(images_), yuv = production.picture(i420);

    int64_t covered = 0, covered_within = 0, within = 0, luma_within = 0;
    const int64_t pixels = static_cast<int64_t>(expected.pixels.size());
    for (int64_t i = 0; i < pixels; i++) {
      const uint8_t *p = &rgb.data()[3 * i], *q = &reference_image.data()[3 * i];
      const reference::Pixel& pixel = expected.pixels[i];
      int error = 0;
      for (int c = 0; c < 3; c++) {
        error = std::max(error, std::abs(p[c] - q[c]));
        if (pixel.coverage > kLeastCompared) {
          ASSERT_LE(std::abs(p[c] - q[c]), rounding_bound(pixel, pixel.colour[c])) << view.name << " pixel " << i;
        }
      }
      within += error <= 1;
      if (coverage[i] <= kCovered) continue;
      covered++;
      covered_within += error <= 1;
      luma_within += std::abs(0.299 * q[0] + 0.587 * q[1] + 0.114 * q[2] - yuv.plane(0)[i]) <= 2;
    }
    const auto fraction = [](int64_t part, int64_t of) { return static_cast<double>(part) / static_cast<double>(of); };
    const Quality by_reference = compare(reference_image, truth, coverage), by_rgb = compare(rgb, truth, coverage),
                  by_i420 = compare(to_rgb(yuv), truth, coverage);
    std::printf("%-8s %8.4f | %9.3f | %8.3f %9.5f %9.5f | %8.3f %9.5f\n", view.name.c_str(), by_reference.coverage,
                by_reference.psnr_db, by_rgb.psnr_db, fraction(covered_within, covered), fraction(within, pixels),
                by_i420.psnr_db, fraction(luma_within, covered));
    EXPECT_NEAR(by_rgb.psnr_db, by_reference.psnr_db, 0.05) << view.name;
    EXPECT_GE(fraction(covered_within, covered), 0.999) << view.name;
    // Chroma at half resolution costs what it costs; luma is rounded once more in the cameras.
    EXPECT_NEAR(by_i420.psnr_db, by_reference.psnr_db, 0.75) << view.name;
    EXPECT_GE(fraction(luma_within, covered), 0.999) << view.name;
  }
}

}  // namespace
}  // namespace lf
