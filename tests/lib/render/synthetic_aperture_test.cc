// SPDX-License-Identifier: LGPL-2.1-or-later
// With a wide aperture, foliage in front of a figure disappears, and out-of-focus objects are blurred.
#include "composite/still.h"
#include "image/image.h"
#include "quality/image_quality.h"
#include "reference/generators.h"
#include "scene/scene.h"
#include "support/photographs.h"
#include "support/rigs.h"
#include "support/test.h"

namespace lf {
namespace synthetic_aperture_test {

constexpr int kWidth = 160, kHeight = 120;
constexpr double kFigure = 3, kFoliage = 1.2;  // metres

double figure_luma(const Vec3& at) {
  const double r = std::hypot(at.x, at.y);
  return r < 0.5 ? 128 + 90 * std::sin(40 * r) : 128 + 60 * std::sin(17 * at.x + 5 * at.y) * std::cos(13 * at.y);
}

// Leaves: discs of 1.2 cm at random places, which hide about 30 % of the background.
struct Foliage {
  Foliage() {
    reference::Random random(5);
    for (int i = 0; i < 1400; i++) leaves.push_back({random.uniform(-0.75, 0.75), random.uniform(-0.6, 0.6)});
    std::ranges::sort(leaves, {}, by_x);
  }
  bool hides(const Vec3& at) const {
    for (auto leaf = std::ranges::lower_bound(leaves, at.x - kRadius, {}, by_x);
         leaf != leaves.end() && leaf->x < at.x + kRadius; ++leaf)
      if (glm::distance(*leaf, Vec2(at)) < kRadius) return true;
    return false;
  }
  static constexpr double kRadius = 0.012;
  static double by_x(const Vec2& leaf) { return leaf.x; }
  std::vector<Vec2> leaves;
};

Image picture_of(const Lens& lens, const Pose& pose, const Foliage* foliage) {
  Image image(PixelFamily::kRgb, kWidth, kHeight);
  for (int y = 0; y < kHeight; y++)
    for (int x = 0; x < kWidth; x++) {
      const Vec3 d = pose.rotation() * Vec3(*lens.unproject(Vec2(x, y)), 1);
      const auto at = [&](double z) { return pose.position + (z - pose.position.z) / d.z * d; };
      const bool hidden = foliage && foliage->hides(at(kFoliage));
      const double luma = hidden ? 40 : figure_luma(at(kFigure));
      const double colour[3] = {luma, hidden ? 90 : luma, hidden ? 30 : luma};
      for (int c = 0; c < 3; c++) image.pixel(x, y)[c] = static_cast<uint8_t>(std::lround(colour[c]));
    }
  return image;
}

class SyntheticAperture : public testing::Test {
 protected:
  void film(const Foliage* foliage) {
    for (const Camera& camera : rig_.cameras) images_.push_back(picture_of(camera.lens, camera.pose, foliage));
  }
  static View view(double focus, const Blending& blending) {
    View view = test::view_from({0.013, -0.017, 0}, kWidth, kHeight, 24, focus);
    view.blending = blending;
    return view;
  }
  Image picture(double focus, const Blending& blending) const {
    return render_still(rig_, build_mesh(rig_), view(focus, blending),
                        [this](CameraIndex i) -> const Image& { return images_[i]; })
        .picture;
  }
  // LF_PICTURES=FOLDER keeps the pictures for inspection.
  static void keep(const Image& picture, const std::string& name) {
    if (const char* folder = std::getenv("LF_PICTURES")) save_image(picture, std::string(folder) + "/" + name + ".png");
  }

  const Rig rig_ = scene_rig(8, 8, kWidth, kHeight);
  std::vector<Image> images_;
};

Blending wide(double aperture) { return {Blending::Kind::kAperture, aperture, 0}; }

// Fits gain and offset to the truth: blurred leaves form a veil that reduces contrast.
Image without_veil(const Image& picture, const Image& truth) {
  Image out = picture;
  const size_t n = picture.data().size() / 3;
  for (size_t c = 0; c < 3; c++) {
    double x = 0, y = 0, xx = 0, xy = 0;
    for (size_t i = c; i < 3 * n; i += 3) {
      const double a = picture.data()[i], b = truth.data()[i];
      x += a / n;
      y += b / n;
      xx += a * a / n;
      xy += a * b / n;
    }
    const double gain = (xy - x * y) / (xx - x * x);
    for (size_t i = c; i < 3 * n; i += 3)
      out.data()[i] = static_cast<uint8_t>(std::clamp(std::lround(y + gain * (picture.data()[i] - x)), 0L, 255L));
  }
  return out;
}

TEST_F(SyntheticAperture, SeesThroughFoliage) {
  const Foliage foliage;
  film(&foliage);
  const Image truth = picture_of(view(kFigure, {}).lens, view(kFigure, {}).pose, nullptr);
  const Image narrow = picture(kFigure, {});
  const double by_mesh = compare(narrow, truth).psnr_db;
  const double mesh_without_veil = compare(without_veil(narrow, truth), truth).psnr_db;
  keep(truth, "truth");
  keep(narrow, "mesh");
  double before = by_mesh, without = 0;
  for (const double aperture : {0.1, 0.2, 0.4}) {
    const Image through = picture(kFigure, wide(aperture));
    const double psnr = compare(through, truth).psnr_db;
    without = compare(without_veil(through, truth), truth).psnr_db;
    std::printf("aperture %.1f m: %.2f dB, without the veil %.2f; by the mesh %.2f and %.2f\n", aperture, psnr, without,
                by_mesh, mesh_without_veil);
    keep(through, "aperture-" + std::to_string(aperture).substr(0, 3));
    EXPECT_GT(psnr, before + 0.3);
    before = psnr;
  }
  EXPECT_GT(before, by_mesh + 3);
  EXPECT_GT(without, mesh_without_veil + 8);
}

double contrast(const Image& picture) {
  double sum = 0, squares = 0;
  int n = 0;
  for (int y = 30; y < kHeight - 30; y++)
    for (int x = 40; x < kWidth - 40; x++, n++) {
      const double v = picture.pixel(x, y)[1];
      sum += v;
      squares += v * v;
    }
  return std::sqrt(squares / n - sum * sum / n / n);
}

TEST_F(SyntheticAperture, DepthOfFieldShrinksWithTheAperture) {
  film(nullptr);
  const double sharp = contrast(picture(kFigure, {}));
  double before = sharp;
  for (const double aperture : {0.12, 0.2, 0.28}) {
    EXPECT_NEAR(contrast(picture(kFigure, wide(aperture))), sharp, 0.02 * sharp);
    const double blurred = contrast(picture(2, wide(aperture)));
    std::printf("aperture %.2f m: contrast %.1f in focus, %.1f in front of it\n", aperture, sharp, blurred);
    EXPECT_LT(blurred, 0.93 * before);
    before = blurred;
  }
}

// For irregular cameras with different lenses and resolutions, blending by angle predicts a view better than triangles.
TEST(ByAngle, ImprovesUnstructuredArrays) {
  reference::Random random(0);
  Rig rig;
  for (uint32_t i = 0; i < 40; i++) {
    const int width = random.one_in(2) ? 160 : 320, height = width * 3 / 4;
    const Lens lens = Lens::pinhole(width * random.uniform(0.8, 1.6), (width - 1) / 2., (height - 1) / 2.);
    const Vec3 place(random.uniform(-0.14, 0.14), random.uniform(-0.14, 0.14), random.uniform(-0.15, 0.15));
    rig.cameras.push_back(reference::make_camera(i, width, height, lens, {place, random.small_rotation(0.05)}));
  }
  rig.topology = {};
  const std::vector<Image> images = test::scene_images(rig);
  const Mesh mesh = build_mesh(rig);
  double gain = 0, covered = 0;
  constexpr int kViews = 3;
  for (int i = 0; i < kViews; i++) {
    const Vec3 eye = random.point_in_box(0.05) - Vec3(0, 0, 0.1);
    View view = test::view_from(eye, 200, 150, 35, kSceneMiddle - eye.z);
    const Image truth = render_scene({view.width, view.height, view.lens, view.pose}, 0, 2);
    const auto still = [&](const Blending& blending) {
      view.blending = blending;
      return render_still(rig, mesh, view, [&](CameraIndex camera) -> const Image& { return images[camera]; });
    };
    const Still by_mesh = still({}), by_angle = still({Blending::Kind::kAngle, 0, 4});
    std::vector<float> both = by_mesh.coverage;
    for (size_t p = 0; p < both.size(); p++) both[p] = std::min(both[p], by_angle.coverage[p]);
    const double mesh_db = compare(by_mesh.picture, truth, both).psnr_db,
                 angle_db = compare(by_angle.picture, truth, both).psnr_db;
    const double mesh_covers = compare(by_mesh.picture, truth, by_mesh.coverage).coverage,
                 angle_covers = compare(by_angle.picture, truth, by_angle.coverage).coverage;
    std::printf("where both cover: %.2f dB by the mesh, %.2f by angle; cover %.3f and %.3f\n", mesh_db, angle_db,
                mesh_covers, angle_covers);
    gain += (angle_db - mesh_db) / kViews;
    covered += (angle_covers - mesh_covers) / kViews;
  }
  EXPECT_GT(gain, 1);
  EXPECT_GT(covered, 0.1);
}

}  // namespace synthetic_aperture_test
}  // namespace lf
