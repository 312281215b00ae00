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
const AnswerForm kForms[] = {{kRaw16, true},  {kRaw, true},  {kJpeg, true},
                             {kRaw16, false}, {kRaw, false}, {kJpeg, false}};

TEST_P(AnswerRendererTest, EveryFormMakesThePicture) {
  const Image exact = picture(render(kForms[0]));
  for (const AnswerForm& form : kForms) {
    const Quality quality = compare(picture(render(form)), exact);
    EXPECT_GT(quality.psnr_db, form.codec == wire::Codec::kJpeg ? 34 : 50)
        << form.sum << " " << static_cast<int>(form.codec);
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
  EXPECT_EQ(lost_planes(render(kForms[0])), 0u);
  sources_[4].image = {};
  EXPECT_EQ(lost_planes(render(kForms[0])), 1u);
  EXPECT_GT(lost_planes(render(kForms[2])), 0u);
}

TEST_P(AnswerRendererTest, NoImagesGiveAnEmptyAnswer) {
  header_.family = PixelFamily::kNone;
  for (Source& source : sources_) source.image = {};
  EXPECT_EQ(render(kForms[0]).fragments, 0u);
}

INSTANTIATE_TEST_SUITE_P(Families, AnswerRendererTest, testing::Values(PixelFamily::kRgb, PixelFamily::kI420));

}  // namespace
}  // namespace lf
