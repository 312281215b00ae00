// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/request_plan.h"

#include "quality/image_quality.h"
#include "scene/scene.h"
#include "support/access_pictures.h"
#include "support/expect_error.h"
#include "support/photographs.h"
#include "support/test.h"
#include "wire/consistency_codec.h"

namespace lf {
namespace {

class RequestPlanTest : public testing::TestWithParam<PixelFamily> {
 protected:
  RequestPlanTest() : rig_(scene_rig(3, 3, 81, 61)), images_(test::scene_images(rig_)) {
    if (GetParam() == PixelFamily::kI420)
      for (Image& image : images_) image = to_i420(image);
    View& view = request_.view;
    view.width = 133;
    view.height = 91;
    view.lens = Lens::from_fov_y(36, view.width, view.height);
    view.focus.plane = focal_plane_at(view.pose, kSceneMiddle);
    request_.quality = 92;
  }

  Quality compare_with(const Image& a, const Image& b) const {
    const bool i420 = GetParam() == PixelFamily::kI420;
    return compare(i420 ? to_rgb(a) : a, i420 ? to_rgb(b) : b);
  }

  Rig rig_;
  std::vector<Image> images_;
  ViewRequest request_;
  const RenderOptions near_{.in_process = true}, raw_{.codec = CodecChoice::kRaw}, jpeg_{.codec = CodecChoice::kJpeg};
  const std::vector<CameraIndex> all_ = {0, 1, 2, 3, 4, 5, 6, 7, 8};
};

TEST_P(RequestPlanTest, EveryAccessMakesTheSamePicture) {
  AccessPictures pictures(rig_, request_, images_);
  const Image self = pictures.picture(Access::kSelf, near_);
  EXPECT_EQ(pictures.picture(Access::kWarp, near_).data(), self.data());
  EXPECT_EQ(pictures.picture(Access::kPixels, near_).data(), self.data());
  EXPECT_EQ(pictures.picture(Access::kPixels, raw_).data(), self.data());
  EXPECT_EQ(pictures.assembly().missing(), 0u);
  for (const Access access : kAccesses) EXPECT_GT(compare_with(pictures.picture(access, jpeg_), self).psnr_db, 30);
}

TEST_P(RequestPlanTest, WarpCommandsAreAnsweredLikeRequests) {
  const AccessPictures pictures(rig_, request_, images_);
  for (const RenderOptions& options : {near_, raw_, jpeg_})
    EXPECT_EQ(pictures.answer(Access::kWarp, all_, options), pictures.answer(Access::kSelf, all_, options));
}

TEST_P(RequestPlanTest, PlansBrightnessMeasurements) {
  View& view = request_.view;
  const auto map = test::level_surface(view.width, view.height, 1 / (2 * kSceneMiddle), 2 / kSceneMiddle, 0);
  std::ranges::fill(map->levels, map->level_of(1 / kSceneMiddle));
  view.focus.map = map;
  const RequestPlan plain(rig_, build_mesh(rig_), request_, all_);
  EXPECT_EQ(plain.gains(), nullptr);
  request_.gains = {.use = true, .ask = true};
  request_.out_of_service = {8};
  const RequestPlan plan(rig_, build_mesh(rig_, request_.out_of_service), request_, all_);
  ASSERT_NE(plan.gains(), nullptr);
  EXPECT_EQ(plan.cameras().size(), 8u) << "all in service";
  std::vector<Source> sources;
  for (const CameraIndex i : plan.cameras()) sources.push_back({i, &rig_.cameras[i], images_[i].view()});
  wire::AnswerHeader header;
  header.family = GetParam();
  header.view_width = static_cast<uint16_t>(view.width);
  header.view_height = static_cast<uint16_t>(view.height);
  ASSERT_NE(plan.wide(), nullptr);
  EXPECT_EQ(plan.wide()->see(sources, {}).cameras.size(), 8u);
  RequestRenderer renderer;
  ImageMemory scratch;
  const RenderedAnswer answer = renderer.render({&plan, header}, sources, near_, scratch);
  const auto unit =
      wire::decode_consistency(answer.brightness, {FocalMap::nodes(map->columns, 2), FocalMap::nodes(map->rows, 2), 1});
  ASSERT_TRUE(unit && unit->gains);
  EXPECT_GT(answer.fragments, 0u);
  EXPECT_TRUE(renderer.render({&plain, header}, sources, near_, scratch).brightness.empty());
}

TEST_P(RequestPlanTest, MissingWeightIsTheSame) {
  request_.view.lens = Lens::from_fov_y(75, 133, 91);
  for (const CameraIndex turned : {0, 4}) rig_.cameras[turned].pose.orientation = glm::angleAxis(3.0, Vec3(0, 1, 0));
  request_.out_of_service = {2};
  images_[8] = {};
  AccessPictures pictures(rig_, request_, images_);
  const Image self = pictures.picture(Access::kSelf, near_);
  EXPECT_EQ(pictures.picture(Access::kWarp, near_).data(), self.data());
  // A missing camera and a blind camera are removed with and without a rounding step.
  EXPECT_LE(compare_with(pictures.picture(Access::kPixels, near_), self).max_error, 3);
}

TEST_P(RequestPlanTest, NodesOfEveryAccessMix) {
  AccessPictures pictures(rig_, request_, images_);
  const Image self = pictures.picture(Access::kSelf, near_);
  const std::vector<CameraIndex> a = {0, 3, 4}, b = {1, 2, 5}, c = {6, 7, 8};
  const Image mixed =
      pictures.picture({pictures.answer(Access::kPixels, a, near_), pictures.answer(Access::kWarp, b, near_),
                        pictures.answer(Access::kSelf, c, near_)});
  EXPECT_EQ(mixed.data(), self.data());
}

TEST_P(RequestPlanTest, DistortedViewsAreTheSame) {
  request_.view.lens = Lens(LensModel::kRadial, {140, 66, 45, -0.2, 0.03});
  AccessPictures pictures(rig_, request_, images_);
  const Image self = pictures.picture(Access::kSelf, near_);
  EXPECT_EQ(pictures.picture(Access::kWarp, near_).data(), self.data());
  EXPECT_EQ(pictures.picture(Access::kPixels, near_).data(), self.data());
}

TEST_P(RequestPlanTest, RefusesRequestsThatDoNotFitTheRig) {
  wire::PixelCommand pixels{request_, 10, 10, {{3, {60, 0, 82, 10}}}};
  MeshCache mesh;
  EXPECT_ERROR(plan_request(rig_, mesh, pixels, all_), "camera 3", "outside");
  EXPECT_TRUE(plan_request(rig_, mesh, pixels, {all_.data(), 2})->cameras().empty()) << "cameras of another node";
  const wire::AnyRequest warp = CameraAccess::of(Access::kWarp)->command(rig_, build_mesh(rig_), request_);
  EXPECT_ERROR(plan_request(rig_subset(rig_, {0, 1, 2}), mesh, warp, {all_.data(), 3}), "3 of the");
}

INSTANTIATE_TEST_SUITE_P(Families, RequestPlanTest, testing::Values(PixelFamily::kRgb, PixelFamily::kI420));

}  // namespace
}  // namespace lf
