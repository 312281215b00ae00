// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/answer_renderer.h"

#include <gtest/gtest.h>

#include <thread>

#include "composite/assembly.h"
#include "quality/quality.h"
#include "scene/scene.h"
#include "wire/answer_parser.h"

namespace lf {
namespace {

// From both ends at once.
void two_threads(size_t count, const std::function<void(size_t)>& task) {
  std::thread other([&] {
    for (size_t i = count; i-- > count / 2;) task(i);
  });
  for (size_t i = 0; i < count / 2; i++) task(i);
  other.join();
}

class AnswerRendererTest : public testing::TestWithParam<PixelFamily> {
 protected:
  AnswerRendererTest() : rig_(scene_rig(3, 3, 80, 60)) {
    for (const Camera& camera : rig_.cameras) {
      const Image rgb = render_scene({camera.width, camera.height, camera.lens, camera.pose}, 0, 1);
      images_.push_back(GetParam() == PixelFamily::kI420 ? to_i420(rgb) : rgb);
    }
    for (CameraIndex i = 0; i < 9; i++) {
      all_.push_back(i);
      sources_.push_back({i, &rig_.cameras[i], images_[i].view()});
    }
    View& view = request_.view;
    view.width = 333;  // several strips, and sizes that are no multiple of anything
    view.height = 431;
    view.lens = Lens::from_fov_y(36, view.width, view.height);
    view.focus.plane = focal_plane_at(view.pose, kSceneMiddle);
    header_.view_width = view.width;
    header_.view_height = view.height;
    header_.family = GetParam();
    header_.rig_hash = rig_.hash();
  }

  RenderedAnswer render(const AnswerForm& form, const ParallelFor& parallel = serial_for) {
    const RenderJob job(rig_, build_mesh(rig_), request_.view, all_);
    std::vector<Source> contributing;
    for (const CameraIndex camera : job.cameras()) contributing.push_back(sources_[camera]);
    return render_answer(header_, job, contributing, form, {}, parallel);
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

const CodedAs kRaw16{wire::Codec::kRaw16, 0}, kRaw{wire::Codec::kRaw, 0}, kJpeg{wire::Codec::kJpeg, 92};
const AnswerForm kForms[] = {{kRaw16, wire::kStripPixels, 1 << 20}, {kRaw16}, {kRaw}, {kJpeg, 1 << 13, 3000}};

TEST_P(AnswerRendererTest, EveryFormMakesThePicture) {
  const Image exact = picture(render(kForms[0]));
  for (const AnswerForm& form : kForms) {
    const Quality quality = compare(picture(render(form)), exact);
    EXPECT_GT(quality.psnr_db, form.codec == wire::Codec::kJpeg ? 34 : 50) << static_cast<int>(form.codec);
    if (form.codec != wire::Codec::kJpeg) {
      EXPECT_LE(quality.max_error, 4);
    }
  }
}

TEST_P(AnswerRendererTest, ThreadsDoNotShowInTheAnswer) {
  for (const AnswerForm& form : kForms) EXPECT_EQ(render(form).bytes, render(form, two_threads).bytes);
}

TEST_P(AnswerRendererTest, LostWeightTravelsOnlyWhereThereIsSome) {
  const auto lost_planes = [](const RenderedAnswer& answer) {
    size_t count = 0;
    const auto parsed = wire::parse_answer(answer.bytes);  // not in the loop's head: it would not live through it
    for (const wire::FragmentView& fragment : parsed->fragments) count += fragment.has_lost;
    return count;
  };
  View& view = request_.view;
  view.lens = Lens::from_fov_y(8, view.width, view.height);  // nothing of it is outside an image
  for (const AnswerForm& form : kForms) EXPECT_EQ(lost_planes(render(form)), 0u);
  sources_[4].image = {};
  EXPECT_EQ(lost_planes(render(kForms[0])), 1u);
  for (const AnswerForm& form : kForms) EXPECT_GT(lost_planes(render(form)), 0u);
}

// The random access camera: what nodes of one camera each send adds up to what one node of all of them does.
TEST_P(AnswerRendererTest, NodesOfOneCameraMakeThePicture) {
  request_.view.pose.position.z = -0.3;  // no camera fills the view
  for (const AnswerForm& form : kForms) {
    const Image together = picture(render(form));
    Assembly assembly;
    assembly.begin(request_);
    size_t pixels = 0, answers = 0;
    const std::vector<CameraIndex> all = all_;
    for (const CameraIndex camera : all) {
      all_ = {camera};
      header_.cameras = CameraRanges(all_);
      const RenderedAnswer answer = render(form);
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
    EXPECT_GT(quality.psnr_db, form.codec == wire::Codec::kJpeg ? 34 : form.codec == wire::Codec::kRaw ? 50 : 98);
    EXPECT_GT(answers, 1u);
    EXPECT_LT(pixels, answers * request_.view.width * request_.view.height);
  }
}

TEST_P(AnswerRendererTest, WhoSeesNothingSendsNothing) {
  const RenderJob job(rig_, build_mesh(rig_), request_.view, all_);
  EXPECT_EQ(render_answer(header_, job, {}, kForms[1]).fragments, 0u) << "no camera has a picture";
}

TEST_P(AnswerRendererTest, NoImagesGiveAnEmptyAnswer) {
  header_.family = PixelFamily::kNone;
  for (Source& source : sources_) source.image = {};
  EXPECT_EQ(render(kForms[0]).fragments, 0u);
}

INSTANTIATE_TEST_SUITE_P(Families, AnswerRendererTest, testing::Values(PixelFamily::kRgb, PixelFamily::kI420));

}  // namespace
}  // namespace lf
