// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/answer_form.h"

#include <gtest/gtest.h>

#include "scene/scene.h"

namespace lf {
namespace {

RenderJob job_of(const Rig& rig, const std::vector<CameraIndex>& own) {
  View view;
  view.width = 80;
  view.height = 60;
  view.lens = Lens::from_fov_y(30, 80, 60);
  view.pose.position = Vec3(0, 0, -1);  // behind the array: all cameras are in it
  view.focus.plane = focal_plane_at(view.pose, kSceneMiddle);
  return {rig, build_mesh(rig), view, own};
}

TEST(AnswerForm, SumsWhereTheSumIsSmaller) {
  const Rig rig = scene_rig(5, 5, 80, 60);
  std::vector<CameraIndex> all(rig.cameras.size());
  for (CameraIndex i = 0; i < all.size(); i++) all[i] = i;
  EXPECT_TRUE(choose_form(job_of(rig, all), SumChoice::kAuto, CodecChoice::kRaw, false, 90).sum);
  // Two of a corner each: what lies between them is empty.
  const RenderJob apart = job_of(rig, {6, 18});
  ASSERT_EQ(apart.cameras().size(), 2u);
  EXPECT_FALSE(choose_form(apart, SumChoice::kAuto, CodecChoice::kRaw, false, 90).sum);
  EXPECT_TRUE(choose_form(apart, SumChoice::kNode, CodecChoice::kRaw, false, 90).sum);
  EXPECT_FALSE(choose_form(job_of(rig, all), SumChoice::kCamera, CodecChoice::kRaw, false, 90).sum);
}

TEST(AnswerForm, TheCodecFollowsLinkAndQuality) {
  using wire::Codec;
  const Rig rig = scene_rig(2, 2, 80, 60);
  const RenderJob job = job_of(rig, {0, 1, 2, 3});
  const struct {
    SumChoice sum;
    CodecChoice choice;
    bool in_process;
    int quality;
    Codec codec;
  } cases[] = {
      {SumChoice::kNode, CodecChoice::kAuto, true, 90, Codec::kRaw16},
      {SumChoice::kCamera, CodecChoice::kAuto, true, 90, Codec::kRaw},
      {SumChoice::kNode, CodecChoice::kAuto, false, 90, Codec::kJpeg},
      {SumChoice::kNode, CodecChoice::kAuto, false, 0, Codec::kRaw},
      {SumChoice::kNode, CodecChoice::kJpeg, true, 90, Codec::kJpeg},
      {SumChoice::kCamera, CodecChoice::kJpeg, true, 0, Codec::kRaw},
      {SumChoice::kCamera, CodecChoice::kRaw16, false, 90, Codec::kRaw16},
      {SumChoice::kNode, CodecChoice::kRaw, true, 90, Codec::kRaw},
  };
  for (const auto& c : cases) {
    const AnswerForm form = choose_form(job, c.sum, c.choice, c.in_process, c.quality);
    EXPECT_EQ(form.codec, c.codec);
    EXPECT_EQ(form.quality, c.codec == Codec::kJpeg ? c.quality : 0);
  }
}

}  // namespace
}  // namespace lf
