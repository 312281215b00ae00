// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/image.h"
#include "lib/render/production.h"
#include "quality/image_quality.h"
#include "reference/generators.h"
#include "reference/numerics.h"
#include "reference/renderer.h"
#include "rig/rig_json.h"
#include "support/test.h"
#include "view/view_path.h"

namespace lf {
namespace {

using reference::array;
using reference::moved;
using reference::Random;
using reference::view_at;

// Compares the hard cases with the reference in 80-bit floating point; prints measured and allowed errors.
void expect_within_bounds(const reference::HardCase& hard, const std::vector<reference::Subject>& subjects) {
  SCOPED_TRACE(hard.name);
  const std::vector<reference::Measured> measured = reference::measure(hard, subjects);
  reference::print_row(hard, measured);
  for (size_t i = 0; i < subjects.size(); i++) {
    SCOPED_TRACE(subjects[i].name);
    EXPECT_LE(measured[i].weight, subjects[i].weight_bound);
    EXPECT_LE(measured[i].partition, subjects[i].partition_bound);
    EXPECT_LE(measured[i].colour, subjects[i].colour_bound);
    EXPECT_GE(measured[i].owned, hard.least_owned);
  }
}

TEST(HardCases, AreWithinTheErrorBounds) {
  const std::vector<reference::Subject> subjects = reference::subjects();
  reference::print_heading(subjects);
  for (const reference::HardCase& hard : reference::hard_cases()) {
    expect_within_bounds(hard, subjects);
    SCOPED_TRACE("enlarged");
    expect_within_bounds(reference::enlarged(hard, reference::kEnlarged), subjects);
  }
}

// If a viewer is at a failed border camera, rounding decides on which side of the border the viewpoint is. The border
// belongs to the array (weights >= 0), so the whole picture must be visible, with the weights of the border's two ends.
TEST(EyeOnTheBorder, SeesTheWholePicture) {
  double largest = 0;
  for (int trial = 0; trial < 200; trial++) {
    Random random(trial);
    const bool removed = trial % 2 == 0;
    const double s = removed ? 0.5 : random.uniform(0.01, 0.99);
    auto [rig, view] = moved(array(), view_at({0, 0, 0}), random.point_in_box(1), random.orientation());
    // Border cameras 12 to 15 in a row: between 12 and 14 without 13, or between 13 and 14.
    const CameraIndex from = removed ? 12 : 13;
    const CameraSet out = removed ? CameraSet{13} : CameraSet{};
    const Vec3 a = rig.cameras[from].pose.position, b = rig.cameras[14].pose.position;
    view.pose.position = removed ? rig.cameras[13].pose.position : a + s * (b - a);
    view.pose.orientation = glm::normalize(view.pose.orientation * random.small_rotation(0.4));
    view.focus.plane = focal_plane_at(view.pose, 2);
    const Mesh mesh = build_mesh(rig, out);
    const auto own_weights = test::Production(rig, mesh, view).own_weights();
    for (const auto& own : own_weights) {
      const double expected = own.camera == from ? 1 - s : own.camera == 14 ? s : 0;
      for (const float weight : own.weight) largest = std::max(largest, std::abs(weight - expected));
    }
    EXPECT_EQ(std::count_if(own_weights.begin(), own_weights.end(),
                            [&](const auto& h) { return h.camera == from || h.camera == 14; }),
              2);
  }
  std::printf("eye on the border, turned: largest weight error %.2g (bound 1e-6)\n", largest);
  EXPECT_LE(largest, 1e-6);
}

// --- the production path (8-bit fragments, compositor) on rendered data with known truth -----------------------------

// Maximum error of 8-bit fragments in a pixel: each valid sample and each lost weight is rounded (0.5); the division by
// the remaining weight enlarges these errors; the two pictures are rounded (1). If all weight is valid, the bound is 1:
// three rounded samples add up to an integer less than 1.5 from their exact sum.
double rounding_bound(const reference::Pixel& pixel, double colour) {
  int valid = 0, lost = 0;
  for (int k = 0; k < pixel.corners; k++) (pixel.valid[k] > 0 ? valid : lost) += pixel.weight[k] > 0;
  if (lost == 0) return 1;
  const double left = pixel.coverage - 0.5 * lost / 255;
  return (0.5 * valid + colour * 0.5 * lost / 255) / left + 1;
}
constexpr double kMinCompared = 0.05;

class Chess : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = test::data_folder("chess");
    if (folder_.empty()) GTEST_SKIP() << "../shared/data/chess is absent";
    rig_ = load_rig(folder_ + "/rig.json");
    views_ = load_views(folder_ + "/views.json");
    for (NamedView& view : views_) view.view.blending.fills_gaps = false;  // the reference renders only the mesh
    mesh_ = build_mesh(rig_);
    images_ = test::load_images(rig_);
  }
  std::string folder_;
  Rig rig_;
  std::vector<NamedView> views_;
  Mesh mesh_;
  std::vector<Image> images_;
};

TEST_F(Chess, EveryViewMatchesTheReferenceQuality) {
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
        if (pixel.coverage > kMinCompared) {
          ASSERT_LE(std::abs(p[c] - q[c]), rounding_bound(pixel, pixel.colour[c])) << view.name << " pixel " << i;
        }
      }
      within += error <= 1;
      if (coverage[i] <= kMinCoverage) continue;
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
    // The bound allows for chroma at half resolution; luma is rounded once more in the cameras.
    EXPECT_NEAR(by_i420.psnr_db, by_reference.psnr_db, 0.75) << view.name;
    EXPECT_GE(fraction(luma_within, covered), 0.999) << view.name;
  }
}

}  // namespace
}  // namespace lf
