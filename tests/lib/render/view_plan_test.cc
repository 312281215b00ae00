// SPDX-License-Identifier: LGPL-2.1-or-later
//
// The plan, pixel ownership and the job of a node; the laws and hard cases are in laws_test.cc and hard_cases_test.cc.
#include "render/view_plan.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "render/ownership.h"
#include "scene/scene.h"
#include "support/camera_part.h"

namespace lf {
namespace {

View middle_view(int width = 60, int height = 45) {
  View view;
  view.width = width;
  view.height = height;
  view.lens = Lens::from_fov_y(20, width, height);
  view.pose.position = Vec3(0, 0, -0.3);
  view.focus.plane = focal_plane_at(view.pose, 2.5);
  return view;
}

TEST(ViewPlan, OwnersAndWeightsDoNotDependOnTheRegion) {
  const Rig rig = scene_rig(4, 4, 64, 48);
  const ViewPlan plan(rig, build_mesh(rig), middle_view());
  const OwnerMap whole(plan, {0, 0, 60, 45}), part(plan, {13, 7, 41, 30});
  for (int y = 7; y < 30; y++)
    for (int x = 13; x < 41; x++) ASSERT_EQ(whole.at(x, y), part.at(x, y));
  EXPECT_EQ(OwnerMap(plan, {-5, -5, 100, 100}).region(), (Rect{0, 0, 60, 45}));
}

TEST(ViewPlan, RectanglesAreUnionsOfFaces) {
  const Rig rig = scene_rig(4, 4, 64, 48);
  const ViewPlan plan(rig, build_mesh(rig), middle_view());
  for (CameraIndex camera = 0; camera < 16; camera++) {
    Rect all;
    for (const FacePlan& face : plan.faces())
      if (std::ranges::count(face.camera, camera)) all = unite(all, face.rect);
    EXPECT_TRUE(intersect(all, plan.camera_rect(camera)) == plan.camera_rect(camera)) << camera;
  }
}

TEST(ViewPlan, AViewThatLooksAwayHasNoContributors) {
  const Rig rig = scene_rig(4, 4, 64, 48);
  View view = middle_view();
  view.pose.orientation = Quat(0, 0, 1, 0);  // half a turn about y
  view.focus.plane = focal_plane_at(view.pose, 2.5);
  EXPECT_TRUE(ViewPlan(rig, build_mesh(rig), view).contributors().empty());
}

TEST(RenderJob, TakesTheNodesOwnCamerasAlone) {
  const Rig rig = scene_rig(4, 4, 64, 48);
  const Mesh mesh = build_mesh(rig);
  const View view = middle_view();
  const std::vector<CameraIndex> own = {5, 6, 15};
  const RenderJob job(rig, mesh, view, own);
  for (const CameraIndex camera : job.cameras()) {
    EXPECT_TRUE(std::ranges::count(own, camera));
    EXPECT_EQ(unite(job.owners().region(), job.plan().camera_rect(camera)), job.owners().region());
  }
  EXPECT_EQ(job.cameras().size(), 3u);
  EXPECT_TRUE(RenderJob(rig, mesh, view, {}).cameras().empty());
}

TEST(MeshCache, FollowsTheCamerasOutOfService) {
  const Rig rig = scene_rig(3, 3, 64, 48);
  MeshCache cache;
  EXPECT_EQ(cache.get(rig, {}).faces.size(), 8u);
  EXPECT_EQ(cache.get(rig, {4}).faces.size(), 6u);
  EXPECT_EQ(cache.get(rig, {}).faces.size(), 8u);
  EXPECT_THROW(cache.get(rig, {99}), Error);
}

TEST(SumRenderer, RefusesAnImageOfAnotherSize) {
  const Rig rig = scene_rig(2, 2, 64, 48);
  const RenderJob job(rig, build_mesh(rig), middle_view(), std::vector<CameraIndex>{0});
  const Image wrong(PixelFamily::kRgb, 64, 47);
  EXPECT_THROW(test::camera_part(job.plan(), job.runs(), {0, &rig.cameras[0], wrong.view()}), Error);
}

TEST(SumRenderer, EveryRgbLayoutGivesTheSamePart) {
  const Rig rig = scene_rig(2, 2, 64, 48);
  const RenderJob job(rig, build_mesh(rig), middle_view(), std::vector<CameraIndex>{0});
  const Image image = render_scene({64, 48, rig.cameras[0].lens, rig.cameras[0].pose}, 0, 1);
  const auto expected = test::camera_part(job.plan(), job.runs(), {0, &rig.cameras[0], image.view()});
  for (const RgbLayout layout :
       {RgbLayout{4, 0, 1, 2}, RgbLayout{4, 2, 1, 0}, RgbLayout{4, 1, 2, 3}, RgbLayout{3, 2, 1, 0}}) {
    std::vector<uint8_t> bytes(64 * 48 * static_cast<size_t>(layout.pixel_stride));
    for (size_t i = 0; i < 64 * 48; i++) {
      uint8_t* pixel = &bytes[i * static_cast<size_t>(layout.pixel_stride)];
      pixel[layout.r] = image.data()[3 * i];
      pixel[layout.g] = image.data()[3 * i + 1];
      pixel[layout.b] = image.data()[3 * i + 2];
    }
    ImageView view = image.view();
    view.layout = layout;
    view.plane[0] = bytes.data();
    view.stride[0] = 64 * layout.pixel_stride;
    EXPECT_EQ(test::camera_part(job.plan(), job.runs(), {0, &rig.cameras[0], view}), expected);
  }
}

TEST(ViewPlan, ChromaAlignedIsWholeSamplesInsideTheView) {
  EXPECT_EQ(chroma_aligned({3, 5, 8, 9}, middle_view(61, 45)), (Rect{2, 4, 8, 10}));
  EXPECT_EQ(chroma_aligned({59, 43, 61, 45}, middle_view(61, 45)), (Rect{58, 42, 61, 45}));
}

}  // namespace
}  // namespace lf
