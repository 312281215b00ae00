// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/still_focus.h"

#include "base/text.h"
#include "composite/still.h"
#include "lib/focus/array_of_walls.h"
#include "quality/image_quality.h"
#include "scene/scene.h"
#include "support/photographs.h"
#include "support/test.h"

namespace lf {
namespace {

TEST(FocusStill, FindsTheSurfaceOfAPipeline) {
  const test::ArrayOfWalls walls;
  View view = walls.view(0);
  view.focus.map = nullptr;
  const DepthEstimator::Settings settings{FocusMode::kSurface, 1.2, 6};
  const auto images = [&](CameraIndex camera) -> const Image& { return walls.images[camera]; };
  const View focused = focus_still(walls.rig, walls.mesh, view, images, settings, 9);

  DepthEstimator control(settings);
  const FocusArray array(walls.rig);
  ViewRequest request;
  request.view = view;
  for (int i = 0; i < 10; i++) {
    std::vector<PhotoConsistency> moments;
    if (!request.hypotheses.empty()) moments = walls.moments(request.view, request.hypotheses, walls.own);
    const DepthEstimator::Plan plan = control.next(request, moments, array);
    request.view = plan.view;
    request.hypotheses = plan.hypotheses;
    request.on_plane = plan.on_plane;
    request.view.focus.plane = plan.plane.value_or(view.focus.plane);
  }
  EXPECT_FALSE(request.on_plane);
  ASSERT_TRUE(focused.focus.map);
  EXPECT_EQ(focused.focus.map->levels, request.view.focus.map->levels);
  EXPECT_EQ(focus_still(walls.rig, walls.mesh, view, images, {}).focus.map, nullptr) << "a plane stays a plane";
}

// The built-in scene, filmed by 14 cameras at irregular places that are far apart.
class IrregularArrayTest : public testing::Test {
 protected:
  IrregularArrayTest() {
    rig_ = scene_rig(4, 4, 320, 240);
    rig_.topology = {};
    rig_.cameras.erase(rig_.cameras.begin() + 9);
    rig_.cameras.pop_back();
    for (CameraIndex i = 0; i < rig_.cameras.size(); i++) {
      Camera& camera = rig_.cameras[i];
      camera.pose.position = 4. * camera.pose.position + Vec3(0.03 * std::sin(5. * i), 0.03 * std::cos(7. * i), 0);
    }
    view_.width = 320;
    view_.height = 240;
    view_.lens = rig_.cameras[0].lens;
    view_.pose.position = {0.03, -0.01, 0};
    view_.focus.plane = focal_plane_at(view_.pose, 2);
  }
  double psnr(const View& focused) const {
    const Still still = render_still(rig_, build_mesh(rig_), focused, image_of_, Resampling::kSharpened);
    const Image truth = render_scene({view_.width, view_.height, view_.lens, view_.pose}, 0);
    return compare(still.picture, truth, still.coverage).psnr_db;
  }
  View focus(const ArrayDepth* depths) const {
    return focus_still(rig_, build_mesh(rig_), view_, image_of_, kSurface, kSettledRounds, nullptr, depths);
  }
  // The images are the same for all tests, and take a second.
  const std::vector<Image>& filmed() const {
    static const std::vector<Image> images = test::scene_images(rig_, 0, 2);
    return images;
  }
  CameraSet all() const { return test::all_cameras(rig_); }

  static constexpr DepthEstimator::Settings kSurface{.mode = FocusMode::kSurface};
  Rig rig_;
  View view_;
  const CameraImages image_of_ = [this](CameraIndex i) -> const Image& { return filmed()[i]; };
};

TEST_F(IrregularArrayTest, DepthsOfTheCamerasGiveABetterPicture) {
  const std::optional<ArrayDepth> depths = estimate_depths(rig_, all(), {{view_}}, image_of_, kSurface);
  ASSERT_TRUE(depths);
  const double plane = psnr(view_), searched = psnr(focus(nullptr)), measured = psnr(focus(&*depths));
  RecordProperty("plane_db", std::to_string(plane));
  RecordProperty("searched_db", std::to_string(searched));
  RecordProperty("measured_db", std::to_string(measured));
  EXPECT_GT(measured, plane + 3);
  EXPECT_GT(measured, searched - 0.3);
}

TEST_F(IrregularArrayTest, LimitsOfTheSearchAreKept) {
  const std::optional<ArrayDepth> depths =
      estimate_depths(rig_, all(), {{view_}}, image_of_, {.mode = FocusMode::kSurface, .near = 2, .far = 4});
  ASSERT_TRUE(depths);
  EXPECT_GE(depths->range().farthest, 0.25);
  EXPECT_LE(depths->range().nearest, 0.5);
}

TEST_F(IrregularArrayTest, ImagesMayBeI420) {
  std::vector<Image> images;
  for (const Image& image : filmed()) images.push_back(to_i420(image));
  const CameraImages image_of = [&](CameraIndex i) -> const Image& { return images[i]; };
  const std::optional<ArrayDepth> depths = estimate_depths(rig_, all(), {{view_}}, image_of, kSurface);
  ASSERT_TRUE(depths);
  EXPECT_GT(psnr(focus(&*depths)), psnr(view_) + 3);
}

TEST_F(IrregularArrayTest, ACameraWithoutAnImageDoesNotContribute) {
  const CameraImages image_of = [this](CameraIndex i) -> const Image& {
    if (i == 0) throw Error("camera 0: has no image");
    return filmed()[i];
  };
  const std::optional<ArrayDepth> depths = estimate_depths(rig_, all(), {{view_}}, image_of, kSurface);
  ASSERT_TRUE(depths);
  EXPECT_GT(psnr(focus(&*depths)), psnr(view_) + 3);
}

// Depths from images of other places are useless.
TEST_F(IrregularArrayTest, UselessDepthsAreNotShown) {
  const CameraImages others = [this](CameraIndex i) -> const Image& { return filmed()[(5 * i + 3) % filmed().size()]; };
  const std::optional<ArrayDepth> depths = estimate_depths(rig_, all(), {{view_}}, others, kSurface);
  ASSERT_TRUE(depths);
  EXPECT_GT(psnr(focus(&*depths)), psnr(view_) - 0.1);
}

// Cameras disagree about a wall that a box hides from some of them. The comparison with the plane, which shows the box
// sharp and the wall blurred, ignores these places.
TEST(FocusStill, HiddenPlacesDoNotCount) {
  Rig rig = scene_rig(4, 3, 160, 120);
  rig.topology = {};
  std::vector<Image> images;
  for (Camera& camera : rig.cameras) {
    camera.pose.position *= 4.;
    Image& image = images.emplace_back(PixelFamily::kRgb, camera.width, camera.height);
    for (int y = 0; y < camera.height; y++)
      for (int x = 0; x < camera.width; x++) {
        const Vec3 d(*camera.lens.unproject({x, y}), 1);
        const Vec3 box = camera.pose.position + 1.2 * d, wall = camera.pose.position + 3. * d;
        const bool hits_box = std::abs(box.x) < 0.1 && std::abs(box.y) < 0.1;
        const Vec3& at = hits_box ? box : wall;
        const double texture = std::sin(41 * at.x + 17 * at.y) + std::sin(53 * at.y - 29 * at.x);
        const double luma = hits_box ? 20 + 4 * texture : 200 + 20 * texture;
        for (int c = 0; c < 3; c++)
          image.data()[3 * (static_cast<size_t>(y) * camera.width + x) + c] = static_cast<uint8_t>(std::lround(luma));
      }
  }
  const CameraImages image_of = [&](CameraIndex i) -> const Image& { return images[i]; };
  const View view{160, 120, rig.cameras[0].lens, {}, {focal_plane_at({}, 1.2)}};
  constexpr DepthEstimator::Settings kSurface{.mode = FocusMode::kSurface};
  const ArrayDepth depths(
      rig, test::all_cameras(rig), [&](CameraIndex i) { return images[i].view(); }, 0.1, 1.2);
  const View focused = focus_still(rig, build_mesh(rig), view, image_of, kSurface, 0, nullptr, &depths);
  ASSERT_TRUE(focused.focus.map);
  EXPECT_TRUE(focused.focus.map->measured);
}

// The depth maps are also better than the search where cameras are close together.
TEST(FocusStill, DepthMapsImproveDenseArrays) {
  const Rig rig = scene_rig(4, 4, 320, 240);
  const std::vector<Image> images = test::scene_images(rig, 0, 2);
  const CameraImages image_of = [&](CameraIndex i) -> const Image& { return images[i]; };
  constexpr DepthEstimator::Settings kSurface{.mode = FocusMode::kSurface};
  View view{320, 240, rig.cameras[0].lens, {}, {}};
  view.focus.plane = focal_plane_at(view.pose, 2);
  const Image truth = render_scene({view.width, view.height, view.lens, view.pose}, 0);
  const Mesh mesh = build_mesh(rig);
  const auto psnr = [&](const ArrayDepth* depths) {
    const View focused = focus_still(rig, mesh, view, image_of, kSurface, kSettledRounds, nullptr, depths);
    const Still still = render_still(rig, mesh, focused, image_of, Resampling::kSharpened, {}, nullptr, depths);
    return compare(still.picture, truth, still.coverage).psnr_db;
  };
  const std::optional<ArrayDepth> depths = estimate_depths(rig, test::all_cameras(rig), {{view}}, image_of, kSurface);
  ASSERT_TRUE(depths);
  const double searched = psnr(nullptr), measured = psnr(&*depths);
  RecordProperty("searched_db", std::to_string(searched));
  RecordProperty("measured_db", std::to_string(measured));
  EXPECT_GT(measured, searched + 0.5);
}

// The depths are estimated only for cameras around the eye and cameras that contribute.
TEST(FocusStill, OnlyNeededCamerasHaveDepths) {
  const Rig rig = scene_rig(2, 16, 160, 120);
  const std::vector<Image> images = test::scene_images(rig, 0, 1);
  const CameraImages image_of = [&](CameraIndex i) -> const Image& { return images[i]; };
  View view{160, 120, rig.cameras[0].lens, {}, {}};
  view.pose.position = rig.cameras[0].pose.position;
  view.focus.plane = focal_plane_at(view.pose, 2);
  const std::optional<ArrayDepth> depths =
      estimate_depths(rig, test::all_cameras(rig), {{view}}, image_of, {.mode = FocusMode::kSurface});
  ASSERT_TRUE(depths);
  EXPECT_EQ(depths->cameras(), (CameraSet{0, 1, 2, 3, 4, 5, 6, 7, 16, 17, 18, 19, 20, 21, 22, 23}));
}

TEST_F(IrregularArrayTest, SomeViewsNeedNoDepths) {
  EXPECT_FALSE(estimate_depths(rig_, {3}, {{view_}}, image_of_, kSurface)) << "a single camera";
  EXPECT_FALSE(estimate_depths(rig_, all(), {{view_}}, image_of_, {})) << "a plane";
  EXPECT_FALSE(estimate_depths(rig_, all(), {{view_}}, image_of_, {.mode = FocusMode::kSurface, .near = 4, .far = 2}));
}

}  // namespace
}  // namespace lf
