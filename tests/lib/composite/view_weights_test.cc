// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/view_weights.h"
#include "image/image.h"
#include "reference/generators.h"
#include "scene/scene.h"
#include "support/rigs.h"
#include "support/test.h"

namespace lf {
namespace {

TEST(ViewCoverage, MovingViewIsMeasuredRarelyUnlessExact) {
  const Rig rig = scene_rig(3, 3, 80, 60);
  ViewRequest request;
  request.view = {.width = 64, .height = 48, .lens = Lens::pinhole(200, 31.5, 23.5), .pose = {}, .focus = {}};
  request.view.focus.plane = focal_plane_at(request.view.pose, kSceneMiddle);
  ViewCoverage coverage;
  const double inside = coverage.share(rig, request, {}, false, 1).seen;
  EXPECT_GT(inside, 0.5);
  EXPECT_LE(inside, 1);
  EXPECT_EQ(coverage.share(rig, request, {}, true, 1).extrapolated, 0);
  request.view.pose.position.x = 0.15;  // beside the array
  const MeanCoverage beside = coverage.share(rig, request, {}, true, 1);
  EXPECT_GT(beside.seen, 0.3);
  EXPECT_GT(beside.extrapolated, 0.9 * beside.seen);
  request.view.pose.position.x = 0;
  EXPECT_EQ(coverage.share(rig, request, {}, true, 1).seen, inside);
  request.view.pose.position.x = 100;
  EXPECT_EQ(coverage.share(rig, request, {}, false, ViewCoverage::kInterval).seen, inside);
  EXPECT_EQ(coverage.share(rig, request, {}, true, ViewCoverage::kInterval).seen, 0);
  request.view.pose.position.x = 0;
  EXPECT_EQ(coverage.share(rig, request, {}, false, 2 * ViewCoverage::kInterval).seen, inside);

  EXPECT_LT(coverage.share(rig, request, {4}, true, 2 * ViewCoverage::kInterval).seen, 0.5)
      << "share of the middle camera";
  for (CameraIndex i = 0; i < rig.cameras.size(); i++) request.out_of_service.push_back(i);
  EXPECT_EQ(coverage.share(rig, request, {}, true, 2 * ViewCoverage::kInterval).seen, 0) << "no camera left";
  coverage.clear();
  request.out_of_service.clear();
  EXPECT_EQ(coverage.share(rig, request, {}, false, 1).seen, inside);
}

CameraRanges all_of(const Rig& rig) { return CameraRanges(test::all_cameras(rig)); }

struct Case {
  Case() {
    request.view = {.width = 101, .height = 77, .lens = Lens::pinhole(90, 50, 38), .pose = {}, .focus = {}};
    request.view.pose.position = {0.02, -0.01, -0.12};
    request.view.blending.extrapolates = false;
    request.view.focus.plane = focal_plane_at(request.view.pose, kSceneMiddle);
    reference::Random random(1);
    picture = reference::smooth_image(random, request.view.width, request.view.height);
  }
  Image drawn(WeightOverlayMode what, const CameraRanges& seeing) {
    Image image = picture;
    draw(what, seeing, image);
    return image;
  }
  void draw(WeightOverlayMode what, const CameraRanges& seeing, Image& image, const Levels& levels = kFullLevels) {
    const ImageView of = image.view();
    WeightOverlay::Picture on{.family = of.family, .layout = of.layout, .levels = levels};
    for (int i = 0; i < 3; i++) {
      on.plane[i] = const_cast<uint8_t*>(of.plane[i]);
      on.stride[i] = of.stride[i];
    }
    overlay.draw(what, rig, request, seeing, on);
  }
  const Rig rig = scene_rig(3, 3, 80, 60);
  const Mesh mesh = build_mesh(rig);
  ViewRequest request;
  Image picture;
  WeightOverlay overlay;
};

int difference(const uint8_t* a, const uint8_t* b) {
  int most = 0;
  for (int c = 0; c < 3; c++) most = std::max(most, std::abs(a[c] - b[c]));
  return most;
}

template <typename F>
bool around(int x, int y, int width, int height, const F& has) {
  for (int j = std::max(y - 4, 0); j <= std::min(y + 4, height - 1); j++)
    for (int i = std::max(x - 4, 0); i <= std::min(x + 4, width - 1); i++)
      if (!has(i, j)) return false;
  return true;
}

TEST(WeightOverlay, ContributionsMatchTheMap) {
  Case c;
  const int width = c.request.view.width, height = c.request.view.height;
  const ViewPlan plan(c.rig, c.mesh, c.request.view);
  const FaceIdMap owners(plan, {0, 0, width, height});
  const std::vector<float> lost = missing_weights(c.rig, plan, owners);
  const Image map = contribution_map(c.rig, c.mesh, c.request.view, &c.picture);
  const Image drawn = c.drawn(WeightOverlayMode::kContributions, all_of(c.rig));
  int compared = 0, outside = 0, lines = 0;
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++) {
      const int32_t owner = owners.at(x, y);
      if (owner == FaceIdMap::kNone) {
        const uint8_t black[3] = {};
        ASSERT_EQ(difference(drawn.pixel(x, y), black), 0) << x << " " << y;
        outside++;
        continue;
      }
      lines += drawn.pixel(x, y)[0] == 20 && drawn.pixel(x, y)[1] == 20;
      const bool inner = around(x, y, width, height, [&](int i, int j) {
        return owners.at(i, j) == owner && lost[static_cast<size_t>(j) * width + i] < 1e-6;
      });
      if (!inner) continue;
      ASSERT_LE(difference(drawn.pixel(x, y), map.pixel(x, y)), 1) << x << " " << y;
      compared++;
    }
  EXPECT_GT(compared, 200);
  EXPECT_GT(outside, 200);
  EXPECT_GT(lines, 50);
}

TEST(WeightOverlay, CoverageMatchesTheHeatMap) {
  Case c;
  const int width = c.request.view.width, height = c.request.view.height;
  const ViewPlan plan(c.rig, c.mesh, c.request.view);
  const FaceIdMap owners(plan, {0, 0, width, height});
  const std::vector<float> lost = missing_weights(c.rig, plan, owners);
  const Image map = heat_map(lost, width, height, 1, &c.picture);
  const Image drawn = c.drawn(WeightOverlayMode::kCoverage, all_of(c.rig));
  int compared = 0;
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++) {
      const float here = lost[static_cast<size_t>(y) * width + x];
      const bool inner = around(x, y, width, height, [&](int i, int j) {
        const float there = lost[static_cast<size_t>(j) * width + i];
        return std::isnan(here) ? std::isnan(there) : there == here;
      });
      if (!inner) continue;
      ASSERT_LE(difference(drawn.pixel(x, y), map.pixel(x, y)), 1) << x << " " << y;
      compared++;
    }
  EXPECT_GT(compared, 200);
}

TEST(WeightOverlay, MissingCameraIsDarkUntilOutOfService) {
  Case c;
  const ViewPlan plan(c.rig, c.mesh, c.request.view);
  const FaceIdMap owners(plan, {0, 0, c.request.view.width, c.request.view.height});
  const std::vector<CameraFootprint> places = camera_footprints(c.rig, plan, owners);
  const auto place = std::ranges::find(places, CameraIndex{4}, &CameraFootprint::camera);
  ASSERT_NE(place, places.end());
  const int x = static_cast<int>(place->middle.x) / 4 * 4 + 1, y = static_cast<int>(place->middle.y) / 4 * 4 + 1;
  const auto light = [&](const CameraRanges& seeing) {
    const Image drawn = c.drawn(WeightOverlayMode::kContributions, seeing);
    return drawn.pixel(x, y)[0] + drawn.pixel(x, y)[1] + drawn.pixel(x, y)[2];
  };
  CameraRanges others = all_of(c.rig);
  others.remove(CameraRanges(CameraSet{4}));
  const int before = light(all_of(c.rig));
  EXPECT_LT(light(others), before / 2);
  c.request.out_of_service = {4};
  EXPECT_GT(light(others), before / 2);
}

TEST(WeightOverlay, UsesVideoLevels) {
  Case c;
  const Image wanted = to_i420(c.drawn(WeightOverlayMode::kContributions, all_of(c.rig)));
  Image video = to_i420(c.picture);
  const ImageView planes = video.view();
  const auto scale = [](uint8_t value, float gain, float offset) {
    return static_cast<int>(std::lround(gain * value + offset));
  };
  for (int y = 0; y < video.height(); y++)
    for (int x = 0; x < video.width(); x++) {
      uint8_t& luma = const_cast<uint8_t*>(planes.plane[0])[y * planes.stride[0] + x];
      luma = static_cast<uint8_t>(scale(luma, kVideoLevels.gain, kVideoLevels.offset));
    }
  c.draw(WeightOverlayMode::kContributions, all_of(c.rig), video, kVideoLevels);
  const ImageView made = video.view(), as_full = wanted.view();
  double luma = 0, chroma = 0;
  for (int y = 0; y < video.height(); y++)
    for (int x = 0; x < video.width(); x++)
      luma = std::max(luma, std::abs(made.plane[0][y * made.stride[0] + x] -
                                     (kVideoLevels.gain * as_full.plane[0][y * as_full.stride[0] + x] + 16.0)));
  for (int plane : {1, 2})
    for (int y = 0; y < chroma_size(video.height()); y++)
      for (int x = 0; x < chroma_size(video.width()); x++)
        chroma = std::max(
            chroma, std::abs(made.plane[plane][y * made.stride[plane] + x] - 128 -
                             kVideoLevels.chroma_gain * (as_full.plane[plane][y * as_full.stride[plane] + x] - 128.0)));
  EXPECT_LE(luma, 2.5);
  EXPECT_LE(chroma, 2.5);
}

}  // namespace
}  // namespace lf
