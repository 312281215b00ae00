// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/assembly.h"
#include "node/request_renderer.h"
#include "quality/image_quality.h"
#include "scene/scene.h"
#include "support/photographs.h"
#include "support/test.h"
#include "wire/answer_codec.h"

namespace lf {
namespace {

TEST(Coding, CodecDependsOnLinkAndQuality) {
  using wire::Codec;
  const struct {
    CodecChoice choice;
    bool in_process;
    int quality;
    Codec codec;
  } cases[] = {
      {CodecChoice::kAuto, true, 90, Codec::kRaw16}, {CodecChoice::kAuto, false, 90, Codec::kJpeg},
      {CodecChoice::kAuto, false, 0, Codec::kRaw},   {CodecChoice::kJpeg, true, 90, Codec::kJpeg},
      {CodecChoice::kJpeg, true, 0, Codec::kRaw},    {CodecChoice::kRaw16, false, 90, Codec::kRaw16},
      {CodecChoice::kRaw, true, 90, Codec::kRaw},
  };
  for (const auto& c : cases) {
    const Coding coding = choose_coding(c.choice, c.in_process, c.quality);
    EXPECT_EQ(coding.codec, c.codec);
    EXPECT_EQ(coding.quality, c.codec == Codec::kJpeg ? c.quality : 0);
  }
}

TEST(Coding, EmptyPixelsAreAvoidedOnLinks) {
  View view;
  view.width = 640;
  view.height = 480;
  const size_t raw16 = max_extra_pixels(view, wire::Codec::kRaw16, false);
  const size_t jpeg = max_extra_pixels(view, wire::Codec::kJpeg, false);
  EXPECT_LT(raw16, jpeg);
  EXPECT_LT(jpeg, max_extra_pixels(view, wire::Codec::kRaw16, true));
}

void two_threads(size_t count, const std::function<void(size_t)>& task) {
  std::thread other([&] {
    for (size_t i = count; i-- > count / 2;) task(i);
  });
  for (size_t i = 0; i < count / 2; i++) task(i);
  other.join();
}

class AnswerEncoderTest : public testing::TestWithParam<PixelFamily> {
 protected:
  AnswerEncoderTest()
      : rig_(scene_rig(3, 3, 80, 60)), images_(test::scene_images(rig_)), all_(test::all_cameras(rig_)) {
    if (GetParam() == PixelFamily::kI420)
      for (Image& image : images_) image = to_i420(image);
    for (const CameraIndex i : all_) sources_.push_back({i, &rig_.cameras[i], images_[i].view()});
    View& view = request_.view;
    view.width = 333;  // several strips, and sizes that are not multiples of the block size
    view.height = 431;
    view.lens = Lens::from_fov_y(36, view.width, view.height);
    view.focus.plane = focal_plane_at(view.pose, kSceneMiddle);
    request_.quality = 92;
    header_.view_width = view.width;
    header_.view_height = view.height;
    header_.family = GetParam();
    header_.rig_hash = rig_.hash();
  }

  RenderedAnswer render(const RenderOptions& options, bool any_images = true) {
    const RequestPlan plan(rig_, build_mesh(rig_), request_, all_);
    std::vector<Source> contributing;
    if (any_images)
      for (const CameraIndex camera : plan.cameras()) contributing.push_back(sources_[camera]);
    ImageMemory scratch;
    return RequestRenderer().render({&plan, header_}, contributing, options, scratch);
  }
  Image picture(const RenderedAnswer& answer) {
    const auto view = wire::parse_answer(answer.bytes);
    EXPECT_TRUE(view);
    if (!view) return {};
    EXPECT_EQ(view->fragments.size(), answer.fragments);
    Assembly assembly;
    assembly.begin(request_);
    EXPECT_EQ(assembly.add(*view), Assembly::Verdict::kAdded);
    assembly.finish(GetParam(), false);
    const Image image = assembly.picture().resolve();
    return GetParam() == PixelFamily::kI420 ? to_rgb(image) : image;
  }

  Rig rig_;
  std::vector<Image> images_;
  std::vector<Source> sources_;
  std::vector<CameraIndex> all_;
  ViewRequest request_;
  wire::AnswerHeader header_;
};

const RenderOptions kManners[] = {{.codec = CodecChoice::kRaw16, .in_process = true},
                                  {.codec = CodecChoice::kRaw16},
                                  {.codec = CodecChoice::kRaw},
                                  {.codec = CodecChoice::kJpeg, .strip_pixels = 1 << 13}};

TEST_P(AnswerEncoderTest, EveryCodecMakesThePicture) {
  const Image exact = picture(render(kManners[0]));
  for (const RenderOptions& options : kManners) {
    const Quality quality = compare(picture(render(options)), exact);
    EXPECT_GT(quality.psnr_db, options.codec == CodecChoice::kJpeg ? 34 : 50) << static_cast<int>(options.codec);
    if (options.codec != CodecChoice::kJpeg) {
      EXPECT_LE(quality.max_error, 6) << "where little of the weight remains";
    }
  }
}

TEST_P(AnswerEncoderTest, AnswersDoNotDependOnThreads) {
  for (const RenderOptions& options : kManners) {
    RenderOptions threaded = options;
    threaded.parallel = two_threads;
    EXPECT_EQ(render(options).bytes, render(threaded).bytes);
  }
}

TEST_P(AnswerEncoderTest, MissingWeightIsSentOnlyIfPresent) {
  const auto missing_planes = [](const RenderedAnswer& answer) {
    size_t count = 0;
    // a separate variable, because a range-for would not keep the temporary alive
    const auto parsed = wire::parse_answer(answer.bytes);
    for (const wire::FragmentView& fragment : parsed->fragments) count += fragment.has_missing;
    return count;
  };
  View& view = request_.view;
  view.lens = Lens::from_fov_y(8, view.width, view.height);
  for (const RenderOptions& options : kManners) EXPECT_EQ(missing_planes(render(options)), 0u);
  sources_[4].image = {};
  EXPECT_EQ(missing_planes(render(kManners[0])), 1u);
  for (const RenderOptions& options : kManners) EXPECT_GT(missing_planes(render(options)), 0u);
}

TEST_P(AnswerEncoderTest, NodesOfOneCameraMakeThePicture) {
  request_.view.pose.position.z = -0.3;
  request_.view.blending.extrapolates = false;
  for (const RenderOptions& options : kManners) {
    const Image together = picture(render(options));
    Assembly assembly;
    assembly.begin(request_);
    size_t pixels = 0, answers = 0;
    const std::vector<CameraIndex> all = all_;
    for (const CameraIndex camera : all) {
      all_ = {camera};
      header_.cameras = CameraRanges(all_);
      const RenderedAnswer answer = render(options);
      const auto view = wire::parse_answer(answer.bytes);
      ASSERT_TRUE(view);
      for (const wire::FragmentView& fragment : view->fragments)
        pixels += static_cast<size_t>(fragment.rect.width()) * fragment.rect.height();
      answers += answer.fragments > 0;
      EXPECT_EQ(assembly.add(*view), Assembly::Verdict::kAdded);
    }
    all_ = all;
    assembly.finish(GetParam(), false);
    const Image added = assembly.picture().resolve();
    const Quality quality = compare(GetParam() == PixelFamily::kI420 ? to_rgb(added) : added, together);
    EXPECT_GT(quality.psnr_db, options.codec == CodecChoice::kJpeg ? 34 : options.codec == CodecChoice::kRaw ? 50 : 98);
    EXPECT_GT(answers, 1u);
    EXPECT_LT(pixels, answers * request_.view.width * request_.view.height);
  }
}

TEST_P(AnswerEncoderTest, InvisibleCamerasSendNothing) {
  EXPECT_EQ(render(kManners[1], false).fragments, 0u) << "no camera has a frame";
}

TEST_P(AnswerEncoderTest, NoImagesGiveAnEmptyAnswer) {
  header_.family = PixelFamily::kNone;
  for (Source& source : sources_) source.image = {};
  EXPECT_EQ(render(kManners[0]).fragments, 0u);
}

INSTANTIATE_TEST_SUITE_P(Families, AnswerEncoderTest, testing::Values(PixelFamily::kRgb, PixelFamily::kI420));

}  // namespace
}  // namespace lf
