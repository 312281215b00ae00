// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/feature_tracks.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "rig/rig.h"
#include "support/expect_error.h"

namespace lf {
namespace {

// A wall of soft random spots at z = 2, seen by each camera.
Image picture(const Camera& camera) {
  constexpr int kCells = 64;
  constexpr double kCell = 0.05;  // metres
  static const std::vector<double> values = [] {
    std::mt19937 random(1);
    std::vector<double> v(kCells * kCells);
    for (double& x : v) x = std::uniform_real_distribution<double>(30, 220)(random);
    return v;
  }();
  Image image(PixelFamily::kRgb, camera.width, camera.height);
  for (int y = 0; y < camera.height; y++)
    for (int x = 0; x < camera.width; x++) {
      const Vec3 ray = camera.pose.rotation() * Vec3(*camera.lens.unproject(Vec2(x, y)), 1);
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
      for (int c = 0; c < 3; c++)
        image.pixel(x, y)[c] = static_cast<uint8_t>(std::lround(upper + (lower - upper) * soft(fv)));
    }
  return image;
}

TEST(FeatureTracks, FollowsCornersToHundredthsOfAPixel) {
  const Rig nominal = make_grid_rig({3, 3, 0.06, 40, 160, 120});
  // Mounted by hand: what the nominal rig does not know.
  Rig rig = nominal;
  std::mt19937 random(2);
  std::normal_distribution<double> normal(0, 0.01);
  for (Camera& camera : rig.cameras) {
    camera.pose.position += Vec3(normal(random), normal(random), 0) * 0.3;
    camera.pose.orientation = glm::normalize(Quat(1, normal(random) / 2, normal(random) / 2, normal(random) / 2));
  }
  std::vector<Image> images;
  for (const Camera& camera : rig.cameras) images.push_back(picture(camera));
  FeatureOptions options;
  options.references = 3;
  const Tracks tracks = track_features(nominal, images, options);
  EXPECT_FALSE(tracks.ordered);
  EXPECT_GT(tracks.num_positions, 50u);
  EXPECT_GT(tracks.observations.size(), 5 * tracks.num_positions);
  check_tracks(tracks, "tracks");

  // Where the first camera of a track sees it on the wall, the others do, too.
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

TEST(FeatureTracks, SaysWhenThereIsNothingToFollow) {
  const Rig rig = make_grid_rig({2, 2, 0.06, 40, 160, 120});
  const std::vector<Image> grey(4, Image(PixelFamily::kRgb, 160, 120));
  EXPECT_ERROR(track_features(rig, grey), "only 0 corners were found again");
  EXPECT_ERROR(track_features(rig, {}), "at least two cameras");
}

}  // namespace
}  // namespace lf
