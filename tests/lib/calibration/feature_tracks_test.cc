// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/feature_tracks.h"
#include "rig/rig.h"
#include "support/expect_error.h"
#include "support/test.h"

namespace lf {
namespace {

double pattern(const Vec2& p) {
  return 120 + 30 * std::sin(0.5 * p.x + 0.2 * p.y) + 25 * std::sin(0.31 * p.y - 0.2 * p.x + 1) +
         20 * std::cos(0.4 * p.x + 0.45 * p.y);
}

Image image_of(int width, int height, const std::function<double(const Vec2&)>& value) {
  Image image(PixelFamily::kRgb, width, height);
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++)
      for (int c = 0; c < 3; c++) image.pixel(x, y)[c] = static_cast<uint8_t>(std::lround(value(Vec2(x, y))));
  return image;
}

SplineImage picture(const std::function<double(const Vec2&)>& value) { return SplineImage(image_of(80, 60, value)); }

// The view of another camera: stretched by 8 %, sheared, slightly rotated, darker and with less contrast.
constexpr Vec2 kPoint(38.3, 29.6), kThere(41.72, 27.18);
double elsewhere(const Vec2& p) {
  const Vec2 d = p - kThere;
  return 0.8 * pattern(kPoint + Vec2(1.08 * d.x + 0.05 * d.y, -0.03 * d.x + 0.97 * d.y)) - 5;
}

TEST(Patch, WarpedPatchIsFoundToHundredthsOfAPixel) {
  const auto patch = Patch::cut(picture(pattern), kPoint).value();
  const SplineImage other = picture(elsewhere);
  for (const Vec2& off : {Vec2(0, 0), Vec2(1, 0), Vec2(-0.7, 0.9)}) {
    const auto match = patch.find(other, kThere + off).value();
    EXPECT_LT(glm::length(match.point - kThere), 0.02);
    EXPECT_GT(match.correlation, 0.999);
  }
}

TEST(Patch, MissingPatchIsNotFound) {
  const auto patch = Patch::cut(picture(pattern), kPoint).value();
  const SplineImage other = picture([](const Vec2& p) { return 128 + 40 * std::sin(p.x * p.y * 0.01); });
  const auto match = patch.find(other, Vec2(40, 30));
  EXPECT_TRUE(!match || match->correlation < 0.8);
  EXPECT_FALSE(patch.find(picture(pattern), Vec2(5, 30)));
  EXPECT_FALSE(patch.find(picture([](const Vec2&) { return 100.0; }), Vec2(40, 30)));
}

TEST(Patch, NeedsTexture) {
  EXPECT_FALSE(Patch::cut(picture([](const Vec2&) { return 100.0; }), kPoint));
  EXPECT_FALSE(Patch::cut(picture([](const Vec2& p) { return p.x < 38 ? 50.0 : 200.0; }), kPoint));
  EXPECT_FALSE(Patch::cut(picture(pattern), Vec2(5, 30)));
}

double wave(double x, double y) { return 128 + 60 * std::sin(0.8 * x + 0.3) * std::cos(0.6 * y); }

Image wave_picture() {
  return image_of(40, 30, [](const Vec2& p) { return wave(p.x, p.y); });
}

TEST(SplineImage, InterpolatesThePixels) {
  const Image image = wave_picture();
  const SplineImage spline(image);
  for (int y = 1; y < 28; y++)
    for (int x = 1; x < 38; x++) EXPECT_NEAR(spline.value(x, y), image.pixel(x, y)[0], 1e-2) << x << ' ' << y;
}

TEST(SplineImage, IsAsSharpBetweenPixelsAsOnThem) {
  const SplineImage spline(wave_picture());
  for (double y = 6; y < 24; y += 0.37)
    for (double x = 6; x < 34; x += 0.41) {
      EXPECT_NEAR(spline.value(x, y), wave(x, y), 1.5);  // bilinear interpolation is off by 7
      const SplineImage::Sample s = spline.sample(x, y);
      EXPECT_FLOAT_EQ(s.value, spline.value(x, y));
      EXPECT_NEAR(s.dx, (spline.value(x + 0.01, y) - spline.value(x - 0.01, y)) / 0.02, 0.1);
      EXPECT_NEAR(s.dy, (spline.value(x, y + 0.01) - spline.value(x, y - 0.01)) / 0.02, 0.1);
    }
}

TEST(SplineImage, EndsAtTheBorderOfTheImage) {
  const SplineImage spline(wave_picture());
  EXPECT_TRUE(spline.has(1, 1));
  EXPECT_FALSE(spline.has(0.9, 5));
  EXPECT_TRUE(spline.has(37.9, 27.9));
  EXPECT_FALSE(spline.has(5, 28));
}

Image wall_picture(const Camera& camera) {
  constexpr int kCells = 64;
  constexpr double kCell = 0.05;  // metres
  static const std::vector<double> values = [] {
    std::mt19937 random(1);
    std::vector<double> v(kCells * kCells);
    for (double& x : v) x = std::uniform_real_distribution<double>(30, 220)(random);
    return v;
  }();
  return image_of(camera.width, camera.height, [&](const Vec2& pixel) {
    const Vec3 ray = camera.pose.rotation() * Vec3(*camera.lens.unproject(pixel), 1);
    const Vec3 at = camera.pose.position + ray * ((2 - camera.pose.position.z) / ray.z);
    const double u = at.x / kCell + kCells / 2.0, v = at.y / kCell + kCells / 2.0;
    const double fu = u - std::floor(u), fv = v - std::floor(v);
    const auto value = [&](int du, int dv) {
      const int column = static_cast<int>(std::floor(u)) + du, row = static_cast<int>(std::floor(v)) + dv;
      return values[std::clamp(row, 0, kCells - 1) * kCells + std::clamp(column, 0, kCells - 1)];
    };
    const auto soft = [](double t) { return t * t * (3 - 2 * t); };
    const double upper = value(0, 0) + (value(1, 0) - value(0, 0)) * soft(fu);
    const double lower = value(0, 1) + (value(1, 1) - value(0, 1)) * soft(fu);
    return upper + (lower - upper) * soft(fv);
  });
}

TEST(FeatureTracks, FollowsCornersToHundredthsOfAPixel) {
  const Rig nominal = make_grid_rig({3, 3, 0.06, 40, 160, 120});
  Rig rig = nominal;
  std::mt19937 random(2);
  std::normal_distribution<double> normal(0, 0.01);
  for (Camera& camera : rig.cameras) {
    camera.pose.position += Vec3(normal(random), normal(random), 0) * 0.3;
    camera.pose.orientation = glm::normalize(Quat(1, normal(random) / 2, normal(random) / 2, normal(random) / 2));
  }
  std::vector<Image> images;
  for (const Camera& camera : rig.cameras) images.push_back(wall_picture(camera));
  FeatureOptions options;
  options.references = 3;
  const Tracks tracks = track_features(nominal, images, options);
  EXPECT_FALSE(tracks.ordered);
  EXPECT_GT(tracks.num_positions, 50u);
  EXPECT_GT(tracks.observations.size(), 5 * tracks.num_positions);
  check_tracks(tracks, "tracks");

  std::vector<std::optional<Vec3>> wall(tracks.num_positions);
  std::vector<double> errors;
  for (const Observation& o : tracks.observations) {
    const Camera& camera = rig.cameras[o.camera];
    const Vec3 ray = camera.pose.rotation() * Vec3(*camera.lens.unproject(o.pixel), 1);
    if (!wall[o.position])
      wall[o.position] = camera.pose.position + ray * (2 / ray.z);
    else
      errors.push_back(glm::length(*camera.lens.project(camera.pose.camera_from_world(*wall[o.position])) - o.pixel));
  }
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.03);
  EXPECT_LT(errors[errors.size() * 95 / 100], 0.1);
}

TEST(FeatureTracks, ThrowsWithoutFeatures) {
  const Rig rig = make_grid_rig({2, 2, 0.06, 40, 160, 120});
  const std::vector<Image> grey(4, Image(PixelFamily::kRgb, 160, 120));
  EXPECT_ERROR(track_features(rig, grey), "0 corners");
  EXPECT_ERROR(track_features(rig, {}), "two cameras");
}

}  // namespace
}  // namespace lf
