// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/camera_access.h"
#include "lib/render/production.h"
#include "node/request_renderer.h"
#include "reference/float_renderer.h"
#include "reference/generators.h"
#include "render/camera_projection.h"
#include "support/access_pictures.h"
#include "support/expect_error.h"
#include "support/test.h"
#include "wire/answer_codec.h"
#include "wire/fragment_codec.h"

namespace lf {
namespace {

// In any view of any rig, including the numerically hard cases, cameras with explicit homographies give bit-identical
// results. Bound: 0.

using reference::Random;

ViewPlan make_homography_plan(const Rig& rig, const Mesh& mesh, const View& view) {
  ViewRequest request;
  request.view = view;
  const auto bytes = wire::encode_any_request(CameraAccess::of(Access::kWarp)->command(rig, mesh, request));
  return {wire::decode_warp_command(bytes).value().warp, rig.cameras.size()};
}

int expect_same_plan(const Rig& rig, const Mesh& mesh, const View& view) {
  const ViewPlan plan(rig, mesh, view), homography_plan = make_homography_plan(rig, mesh, view);
  EXPECT_EQ(homography_plan.contributors(), plan.contributors());
  const Rect whole = test::whole(view);
  const FaceIdMap owners(plan, whole), homography_owners(homography_plan, whole);
  const Rig places_unknown = without_places(rig);
  for (const CameraIndex camera : plan.contributors()) {
    EXPECT_EQ(homography_plan.camera_rect(camera), plan.camera_rect(camera));
    EXPECT_EQ(pixel_weights(homography_plan, homography_owners, camera, whole),
              pixel_weights(plan, owners, camera, whole));
    EXPECT_EQ(CameraProjection(homography_plan, camera, places_unknown.cameras[camera]).camera_from_ray(),
              CameraProjection(plan, camera, rig.cameras[camera]).camera_from_ray());
  }
  return static_cast<int>(plan.contributors().size());
}

TEST(WarpCommand, EqualsThePlanOfAnyView) {
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

TEST(WarpCommand, EqualsThePlanInHardCases) {
  for (const reference::HardCase& hard : reference::hard_cases())
    for (int trial = 0; trial < hard.trials; trial++) {
      SCOPED_TRACE(std::string(hard.name) + " " + std::to_string(trial));
      Random random(trial);
      auto [rig, view] = hard.make(random);
      view.focus.map = nullptr;  // commands contain the viewer's plane
      expect_same_plan(rig, build_mesh(rig), view);
    }
}

TEST(WarpCommand, MatchesTheFloatRenderer) {
  for (int i = 0; i < 50; i++) {
    SCOPED_TRACE(i);
    Random random(i);
    const Rig rig = reference::random_rig(random), rig_without_poses = without_places(rig);
    const Mesh mesh = build_mesh(rig);
    const View view = reference::random_view(random, rig, 24, 16);
    const std::vector<Image> images = reference::images_of(rig, random, reference::noise_image);
    const ViewPlan plan(rig, mesh, view), homography_plan = make_homography_plan(rig, mesh, view);
    const FaceIdMap owners(plan, test::whole(view)), homography_owners(homography_plan, test::whole(view));
    for (const CameraIndex camera : plan.contributors()) {
      const auto self = render_float(plan, owners, camera, rig.cameras[camera], images[camera].view());
      const auto warp = render_float(homography_plan, homography_owners, camera, rig_without_poses.cameras[camera],
                                     images[camera].view());
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
  const RenderOptions near{.in_process = true};
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

TEST(Commands, MakeThePictureInHardCases) {
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

Camera camera_of(int width, int height) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  return camera;
}

std::vector<uint8_t> counting(size_t n) {
  std::vector<uint8_t> bytes(n);
  std::iota(bytes.begin(), bytes.end(), uint8_t{0});
  return bytes;
}

RenderedAnswer pixel_answer(const Camera& camera, const ImageView& image, const Rect& rect, int quality = 0) {
  Rig rig;
  rig.cameras.assign(6, camera);
  wire::PixelCommand command{{}, 4, 4, {{5, rect}}};
  command.quality = static_cast<uint8_t>(quality);
  const std::vector<CameraIndex> own{5};
  const RequestPlan plan(rig, command, own);
  const Source source{5, &rig.cameras[5], image};
  const wire::AnswerHeader header{.view_width = 4, .view_height = 4, .family = image.family};
  ImageMemory scratch;
  return RequestRenderer().render({&plan, header}, {&source, 1}, {}, scratch);
}

TEST(PixelAnswer, AcceptsAnyLayout) {
  const Camera camera = camera_of(9, 7);
  const std::vector<uint8_t> bytes = counting(40 * 7);
  for (const RgbLayout layout : {RgbLayout{}, RgbLayout{4, 2, 1, 0}, RgbLayout{4, 1, 2, 3}}) {
    const ImageView image{PixelFamily::kRgb, 9, 7, layout, {bytes.data()}, {40}};
    const Rect rect{2, 4, 9, 7};
    const RenderedAnswer answer = pixel_answer(camera, image, rect);
    EXPECT_EQ(answer.fragments, 1u);
    const auto view = wire::parse_answer(answer.bytes);
    ASSERT_TRUE(view);
    const wire::FragmentView& fragment = view->fragments[0];
    EXPECT_EQ(fragment.camera, 5u);
    EXPECT_EQ(fragment.rect, rect);
    for (int y = 0; y < 3; y++)
      for (int x = 0; x < 7; x++) {
        const uint8_t* pixel = &bytes[static_cast<size_t>(40 * (y + 4) + layout.pixel_stride * (x + 2))];
        const uint8_t* out = &fragment.payload[static_cast<size_t>(3 * (7 * y + x))];
        EXPECT_EQ(out[0], pixel[layout.r]);
        EXPECT_EQ(out[1], pixel[layout.g]);
        EXPECT_EQ(out[2], pixel[layout.b]);
      }
  }
}

TEST(PixelAnswer, ChromaHasNoOffset) {
  const Camera camera = camera_of(9, 7);
  Image image(PixelFamily::kI420, 9, 7);
  image.data() = counting(image.data().size());
  const RenderedAnswer answer = pixel_answer(camera, image.view(), {2, 4, 9, 7});
  const auto view = wire::parse_answer(answer.bytes);
  ASSERT_TRUE(view);
  wire::FragmentDecoder decoder;
  const FragmentPlanes planes = decoder.decode(view->fragments[0]).value();
  EXPECT_EQ(planes.plane[0][0], image.plane(0)[4 * 9 + 2]);
  EXPECT_EQ(planes.plane[1][1], static_cast<uint8_t>(image.plane(1)[2 * 5 + 2] - 128));
  EXPECT_EQ(planes.plane[2][planes.stride[2]], static_cast<uint8_t>(image.plane(2)[3 * 5 + 1] - 128));
}

TEST(PixelAnswer, JpegIsSentInStrips) {
  const Camera camera = camera_of(640, 480);
  const Image image(PixelFamily::kI420, 640, 480);
  const RenderedAnswer answer = pixel_answer(camera, image.view(), {0, 0, 640, 480}, 90);
  EXPECT_GT(answer.fragments, 3u);
  const auto view = wire::parse_answer(answer.bytes);
  ASSERT_TRUE(view);
  size_t rows = 0;
  for (const wire::FragmentView& fragment : view->fragments) {
    EXPECT_TRUE(fragment.codec == wire::Codec::kJpeg);
    rows += static_cast<size_t>(fragment.rect.height());
  }
  EXPECT_EQ(rows, 480u);
}

TEST(PixelAnswer, RefusesImagesOfAnotherSize) {
  const Camera camera = camera_of(10, 7);
  const Image image(PixelFamily::kRgb, 9, 7);
  EXPECT_ERROR(pixel_answer(camera, image.view(), {0, 0, 4, 4}), "9x7");
}

}  // namespace
}  // namespace lf
