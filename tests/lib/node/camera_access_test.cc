// SPDX-License-Identifier: LGPL-2.1-or-later
// In any view of any rig, the hard cases of numerical stability included, cameras that are told do what those do that
// find out: to the last bit. Bound: 0.
#include "node/camera_access.h"

#include <gtest/gtest.h>

#include "lib/render/production.h"
#include "reference/float_renderer.h"
#include "reference/hard_cases.h"
#include "render/camera_projection.h"
#include "support/access_pictures.h"

namespace lf {
namespace {

using reference::Random;

// What a node makes of a command that came off the wire.
ViewPlan told_plan(const Rig& rig, const Mesh& mesh, const View& view) {
  ViewRequest request;
  request.view = view;
  const auto bytes = wire::encode_any_request(CameraAccess::of(Access::kWarp)->command(rig, mesh, request));
  return {wire::decode_warp_command(bytes).value().warp, rig.cameras.size()};
}

int expect_same_plan(const Rig& rig, const Mesh& mesh, const View& view) {
  const ViewPlan plan(rig, mesh, view), told = told_plan(rig, mesh, view);
  EXPECT_EQ(told.contributors(), plan.contributors());
  const Rect whole = test::whole(view);
  const OwnerMap owners(plan, whole), told_owners(told, whole);
  const Rig places_unknown = without_places(rig);
  for (const CameraIndex camera : plan.contributors()) {
    EXPECT_EQ(told.camera_rect(camera), plan.camera_rect(camera));
    EXPECT_EQ(pixel_weights(told, told_owners, camera, whole), pixel_weights(plan, owners, camera, whole));
    EXPECT_EQ(CameraProjection(told, camera, places_unknown.cameras[camera]).camera_from_ray(),
              CameraProjection(plan, camera, rig.cameras[camera]).camera_from_ray());
  }
  return static_cast<int>(plan.contributors().size());
}

TEST(WarpCommand, IsThePlanOfAnyView) {
  int contributions = 0;
  for (int i = 0; i < 1000; i++) {
    SCOPED_TRACE(i);
    Random random(i);
    Rig rig = reference::random_rig(random);
    for (Camera& camera : rig.cameras) camera.lens = reference::random_lens(random, camera.width, camera.height);
    const CameraSet out = reference::random_out_of_service(random, rig);
    contributions += expect_same_plan(rig, build_mesh(rig, out), reference::random_view(random, rig, 24, 16));
  }
  EXPECT_GT(contributions, 3000);
}

TEST(WarpCommand, IsThePlanInTheHardCases) {
  for (const reference::HardCase& hard : reference::hard_cases())
    for (int trial = 0; trial < hard.trials; trial++) {
      SCOPED_TRACE(std::string(hard.name) + " " + std::to_string(trial));
      Random random(trial);
      auto [rig, view] = hard.make(random);
      view.focus.map = nullptr;  // commands are of the viewer's plane
      expect_same_plan(rig, build_mesh(rig), view);
    }
}

// In double, without the fast renderer.
TEST(WarpCommand, RendersWhatTheFloatRendererRenders) {
  for (int i = 0; i < 50; i++) {
    SCOPED_TRACE(i);
    Random random(i);
    const Rig rig = reference::random_rig(random), told_rig = without_places(rig);
    const Mesh mesh = build_mesh(rig);
    const View view = reference::random_view(random, rig, 24, 16);
    const std::vector<Image> images = reference::images_of(rig, random, reference::noise_image);
    const ViewPlan plan(rig, mesh, view), told = told_plan(rig, mesh, view);
    const OwnerMap owners(plan, test::whole(view)), told_owners(told, test::whole(view));
    for (const CameraIndex camera : plan.contributors()) {
      const auto self = render_float(plan, owners, camera, rig.cameras[camera], images[camera].view());
      const auto warp = render_float(told, told_owners, camera, told_rig.cameras[camera], images[camera].view());
      ASSERT_EQ(self.has_value(), warp.has_value());
      if (!self) continue;
      EXPECT_EQ(warp->rect, self->rect);
      EXPECT_EQ(warp->colour, self->colour);
      EXPECT_EQ(warp->lost, self->lost);
    }
  }
}

void expect_same_pictures(const Rig& rig, const View& view, const std::vector<Image>& images) {
  ViewRequest request;
  request.view = view;
  AccessPictures pictures(rig, request, images);
  const AnswerTask::Options near{.in_process = true};
  const Image self = pictures.picture(Access::kSelf, near);
  EXPECT_EQ(pictures.picture(Access::kWarp, near).data(), self.data());
  EXPECT_EQ(pictures.picture(Access::kPixels, near).data(), self.data());
  EXPECT_EQ(pictures.assembly().missing(), 0u);
}

TEST(Commands, MakeThePictureOfAnyView) {
  for (int i = 0; i < 200; i++) {
    SCOPED_TRACE(i);
    Random random(i);
    const Rig rig = reference::random_rig(random);
    const View view = reference::random_view(random, rig, 80, 60);
    const std::vector<Image> images = reference::images_of(rig, random, reference::noise_image);
    expect_same_pictures(rig, view, i % 2 ? test::i420_of(images) : images);
  }
}

TEST(Commands, MakeThePictureInTheHardCases) {
  for (const reference::HardCase& hard : reference::hard_cases()) {
    const reference::HardCase large = reference::enlarged(hard, reference::kEnlarged);
    for (int trial = 0; trial < large.trials; trial++) {
      SCOPED_TRACE(std::string(large.name) + " " + std::to_string(trial));
      Random random(trial);
      auto [rig, view] = large.make(random);
      view.focus.map = nullptr;
      const std::vector<Image> images = reference::images_of(rig, random, reference::noise_image);
      expect_same_pictures(rig, view, test::i420_of(images));
    }
  }
}

}  // namespace
}  // namespace lf
