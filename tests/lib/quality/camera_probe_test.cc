// SPDX-License-Identifier: LGPL-2.1-or-later
#include "quality/camera_probe.h"

#include <gtest/gtest.h>

#include "composite/still.h"
#include "quality/quality.h"
#include "scene/scene.h"

namespace lf {
namespace {

TEST(CameraProbe, SeesEveryFourthPixelOfTheCamera) {
  Rig rig = scene_rig(3, 3, 320, 240);
  rig.cameras[4].lens = Lens(LensModel::kOpenCv, {300, 310, 150, 130, -0.1, 0.02, 0.001, -0.002});
  rig.cameras[4].pose.orientation = glm::normalize(Quat(1, 0.01, 0.02, 0));
  const Camera& camera = rig.cameras[4];
  const Image image = render_scene({320, 240, camera.lens, camera.pose}, 0);
  View focused{.width = 64, .height = 48, .lens = Lens::pinhole(50, 31.5, 23.5), .pose = {}, .focus = {}};
  focused.focus.plane = focal_plane_at(focused.pose, kSceneMiddle);
  const CameraProbe probe = make_probe(rig, 4, focused, {1, 7});
  EXPECT_TRUE(probe.seen.probe && probe.predicted.probe);
  EXPECT_EQ(probe.seen.view.width, 80);
  EXPECT_EQ(probe.seen.out_of_service, (CameraSet{0, 1, 2, 3, 5, 6, 7, 8}));
  EXPECT_EQ(probe.predicted.out_of_service, (CameraSet{1, 4, 7}));
  EXPECT_EQ(probe.predicted.view.focus, focused.focus);
  validate(probe.seen.view);

  const auto images = [&](CameraIndex) -> const Image& { return image; };
  const Still still = render_still(rig, build_mesh(rig, probe.seen.out_of_service), probe.seen.view, images);
  Image sampled(PixelFamily::kRgb, probe.seen.view.width, probe.seen.view.height);
  for (int y = 0; y < sampled.height(); y++)
    for (int x = 0; x < sampled.width(); x++) std::copy_n(image.pixel(4 * x + 1, 4 * y + 1), 3, sampled.pixel(x, y));
  EXPECT_LE(compare(still.picture, sampled).max_error, 1);
}

TEST(CameraProbe, IsNeverLargerThanItsCamera) {
  Rig rig = scene_rig(2, 2, 50, 37);
  rig.cameras[1].width = 1921;
  rig.cameras[1].height = 1081;
  View focused{.width = 8, .height = 8, .lens = Lens::pinhole(8, 3.5, 3.5), .pose = {}, .focus = {}};
  focused.focus.plane = focal_plane_at(focused.pose, 1);
  const View small = make_probe(rig, 0, focused, {0}).predicted.view, large = make_probe(rig, 1, focused, {}).seen.view;
  EXPECT_EQ(small.width, 50);
  EXPECT_EQ(small.height, 37);
  EXPECT_EQ(small.lens, rig.cameras[0].lens);
  EXPECT_LE(large.width, kProbeColumns);
  EXPECT_EQ(make_probe(rig, 0, focused, {0}).predicted.out_of_service, CameraSet{0});
}

}  // namespace
}  // namespace lf
