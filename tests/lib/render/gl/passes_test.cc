// SPDX-License-Identifier: LGPL-2.1-or-later

#include <GLES3/gl31.h>

#include "lib/render/sum_arrays.h"
#include "render/gl/gles_renderer.h"
#include "render/gl/gpu_sum.h"
#include "render/sum_renderer.h"
#include "support/test.h"

namespace lf {
namespace {

using reference::Random;
using test::Eye;
using test::Sum;

class GlesRendererPasses : public testing::Test {
 protected:
  using Eyes = std::vector<std::unique_ptr<Eye>>;

  std::vector<std::unique_ptr<SumRenderer>> draw(const Eyes& eyes, bool keep_on_gpu = false,
                                                 const ParallelFor& parallel = serial_for) {
    std::vector<std::unique_ptr<SumRenderer>> renderers;
    std::vector<SumRenderer*> all;
    for (const auto& eye : eyes) all.push_back(renderers.emplace_back(eye->renderer(nullptr, keep_on_gpu)).get());
    SumRenderer::draw(all, *gpu_, parallel);
    return renderers;
  }

  void expect_same_alone(const Eyes& eyes, const std::vector<std::unique_ptr<SumRenderer>>& together) {
    for (size_t i = 0; i < eyes.size(); i++) {
      SCOPED_TRACE(testing::Message() << "view " << i);
      const auto alone = eyes[i]->renderer(gpu_.get());
      ASSERT_EQ(together[i]->drawing().drawn, alone->drawing().drawn) << together[i]->drawing().why_not;
      EXPECT_TRUE(alone->drawing().drawn || alone->rect().empty());
      EXPECT_TRUE(eyes[i]->sum_of(*together[i]) == eyes[i]->sum_of(*alone));
    }
  }

  const std::shared_ptr<gl::GlesRenderer> gpu_ = test::new_gpu();  // all sums on the GPU use this renderer
};

bool same(const ConstSumPlanes& a, const Sum& b) {
  for (int c = 0; c < 3; c++)
    if (!std::equal(b.memory[c].begin(), b.memory[c].end(), a.plane[c])) return false;
  return a.lost ? std::equal(b.lost.begin(), b.lost.end(), a.lost)
                : std::ranges::all_of(b.lost, [](uint16_t weight) { return weight == 0; });
}

// Combines views of other sizes, maps and planes, distorted or nearly empty views, missing images, images that only one
// view has, and other resampling.
TEST_F(GlesRendererPasses, EqualSingleViews) {
  size_t passes = 0, views = 0, fixed_up = 0;
  for (int seed = 0; seed < 12; seed++) {
    Random random(seed);
    constexpr int kSide = 4;
    const PixelFamily family = seed % 2 ? PixelFamily::kI420 : PixelFamily::kRgb;
    const Rig rig = test::jittered_array(random, kSide, 161, 120, seed % 3 ? -0.2 : 0);
    const Mesh mesh = build_mesh(rig);
    const auto images_like = [&] { return test::in_family(family, images_of(rig, random, reference::smooth_image)); };
    const std::vector<Image> images = images_like(), others = images_like();
    Eyes eyes;
    for (int i = 0; i < 7; i++) {
      const int width = random.integer(33, 190), height = random.integer(20, 140);
      View view = test::view_into(kSide, width, height, random.small_rotation(seed % 4 == 3 ? 0.6 : 0.1));
      view.pose.position += 0.05 * Vec3(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
      const bool mixed = seed % 4 == 2;
      if (mixed ? random.integer(0, 1) : seed % 4 != 1)
        view.focus.map = test::depths(random, view, random.integer(4, 9), i == 3);
      if (mixed && i == 4) view.lens = Lens(LensModel::kSimpleRadial, {1.25 * width, 50, 40, -0.1});
      Eye& eye = *eyes.emplace_back(std::make_unique<Eye>(rig, mesh, view, i == 5 ? others : images, family));
      for (Source& source : eye.sources)
        if (i == 2 && source.camera % 5 == 0) source.image = {.family = PixelFamily::kNone};
      if (i == 1) eye.sources.resize(1);
    }
    const auto together = draw(eyes);
    passes += gpu_->passes();
    const bool are_alike = seed % 4 != 2;
    EXPECT_LE(gpu_->passes(), are_alike ? 2 : eyes.size()) << "one of another's samples";
    views += eyes.size();
    fixed_up += gpu_->fixed_up();
    SCOPED_TRACE(seed);
    expect_same_alone(eyes, together);
  }
  std::printf("%zu views in %zu passes, %zu fixed up\n", views, passes, fixed_up);
  EXPECT_GE(passes, 12u);
}

TEST_F(GlesRendererPasses, ShareAPass) {
  size_t fixed_up = 0;
  for (int seed = 0; seed < 6; seed++) {
    const PixelFamily family = seed % 2 ? PixelFamily::kI420 : PixelFamily::kRgb;
    Random random(seed);
    const Rig rig = test::jittered_array(random, 4, 160, 120, -0.2);
    const Mesh mesh = build_mesh(rig);
    const std::vector<Image> images = test::in_family(family, images_of(rig, random, reference::smooth_image));
    Eyes eyes;
    for (int i = 0; i < 9; i++) {
      View view = test::view_into(4, 140, 100, i % 4 == 1 ? random.small_rotation(0.9) : Quat(1, 0, 0, 0));
      view.pose.position.x += 0.02 * (i - 4);
      view.focus.map = test::depths(random, view, FocalMap::kMinStep, i == 2);
      eyes.push_back(std::make_unique<Eye>(rig, mesh, view, images, family));
    }
    const auto together = draw(eyes, true);
    EXPECT_EQ(gpu_->passes(), 1u);
    size_t stayed = 0;
    fixed_up += gpu_->fixed_up();
    std::vector<std::shared_ptr<gl::GpuSum>> held;
    for (const auto& renderer : together) {
      EXPECT_FALSE(renderer->drawing().refused) << renderer->drawing().why_not;
      held.push_back(renderer->gpu_sum());
      stayed += held.back() != nullptr;
    }
    EXPECT_GE(stayed, 6u);
    // A held sum keeps its memory: later passes use other memory.
    draw(eyes, true);
    for (size_t i = eyes.size(); i-- > 0;) {
      SCOPED_TRACE(i);
      if (!held[i]) continue;
      const auto alone = eyes[i]->renderer(gpu_.get());
      const Rect rect = held[i]->rect();
      Sum sum(family, rect);
      alone->render_rows(rect.y0, rect.y1, sum.planes);
      EXPECT_TRUE(same(held[i]->fetch(), sum));
      held[i].reset();
    }
  }
  std::printf("%zu fixed up\n", fixed_up);
  EXPECT_GT(fixed_up, 0u);
}

// Views with more than three cameras per pixel are in another pass.
TEST_F(GlesRendererPasses, ViewsWithBlendingShareAPass) {
  for (int seed = 0; seed < 4; seed++) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const PixelFamily family = seed % 2 ? PixelFamily::kI420 : PixelFamily::kRgb;
    const Rig rig = test::jittered_array(random, 4, 161, 120, -0.2);
    const std::vector<Image> images = test::in_family(family, images_of(rig, random, reference::smooth_image));
    Eyes eyes;
    for (int i = 0; i < 6; i++) {
      View view = test::view_into(4, random.integer(33, 150), random.integer(30, 120), random.small_rotation(0.1));
      if (seed > 1) view.focus.map = test::depths(random, view, 8, false);
      if (i < 4) view.blending = i % 2 ? make_blending(0.15, 0) : make_blending(0, 3);
      eyes.push_back(std::make_unique<Eye>(rig, build_mesh(rig), view, images, family));
    }
    const auto together = draw(eyes);
    EXPECT_EQ(gpu_->passes(), 2u);
    expect_same_alone(eyes, together);
  }
}

TEST_F(GlesRendererPasses, UseMorePassesIfNecessary) {
  GLint most = 0;
  gpu_->work([&](gl::Programs&, gl::Buffer&) { glGetIntegerv(GL_MAX_TEXTURE_SIZE, &most); });
  constexpr int kHeight = 4096;
  const int views = most / (kHeight / FocalMap::kMinStep) + 1;
  Random random(4);
  const Rig rig = test::jittered_array(random, 2, 40, 30, 0);
  const Mesh mesh = build_mesh(rig);
  const auto images = images_of(rig, random, reference::smooth_image);
  View view = test::view_into(2, 16, kHeight, Quat(1, 0, 0, 0));
  view.focus.map = test::depths(random, view, FocalMap::kMinStep, false);
  Eyes eyes;
  for (int i = 0; i < views; i++) {
    view.pose.position.x += 1e-3;
    eyes.push_back(std::make_unique<Eye>(rig, mesh, view, images, PixelFamily::kRgb));
  }
  const auto together = draw(eyes);
  EXPECT_EQ(gpu_->passes(), 2u);
  for (const size_t i : {size_t{0}, eyes.size() / 2, eyes.size() - 1}) {
    ASSERT_TRUE(together[i]->drawing().drawn) << together[i]->drawing().why_not;
    EXPECT_TRUE(eyes[i]->sum_of(*together[i]) == eyes[i]->sum_of(*eyes[i]->renderer(gpu_.get())));
  }
}

TEST_F(GlesRendererPasses, AreRefusedIndividually) {
  Random random(5);
  const Rig rig = test::jittered_array(random, 3, 160, 120, 0);
  const Mesh mesh = build_mesh(rig);
  const auto images = images_of(rig, random, reference::smooth_image);
  Eyes eyes;
  for (int i = 0; i < 4; i++) {
    View view = test::view_into(3, 100, 80, random.small_rotation(0.1));
    if (i == 2) {
      view.width = 40000;
      view.lens = Lens::pinhole(1.25 * view.width, (view.width - 1) / 2.0, (view.height - 1) / 2.0);
    }
    eyes.push_back(std::make_unique<Eye>(rig, mesh, view, images, PixelFamily::kRgb));
  }
  const auto together = draw(eyes);
  for (size_t i = 0; i < eyes.size(); i++) EXPECT_EQ(together[i]->drawing().refused, i == 2);
  EXPECT_MENTIONS(together[2]->drawing().why_not, "view", "large");
  EXPECT_TRUE(eyes[3]->sum_of(*together[3]) == eyes[3]->sum_of(*eyes[3]->renderer(gpu_.get())));
  gpu_->lose();
  for (const auto& renderer : draw(eyes)) EXPECT_TRUE(renderer->drawing().refused);
}

}  // namespace
}  // namespace lf
