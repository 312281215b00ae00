// SPDX-License-Identifier: LGPL-2.1-or-later
// Sums of views that more cameras a pixel make than a triangle has, by compute shaders.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <vector>

#include "lib/render/gl/eye.h"
#include "render/gl/sum_drawer.h"
#include "render/sum_renderer.h"

namespace lf {
namespace {

using reference::Random;
using test::Eye;

Blending within(double aperture) { return {.kind = Blending::Kind::kAperture, .aperture = aperture}; }
Blending nearest(int count) { return {.kind = Blending::Kind::kAngle, .nearest = count}; }

class BlendedViews : public testing::Test {
 protected:
  void SetUp() override {
    std::string why;
    card_ = gl::SumDrawer::create(gl::Context::Drivers::kAny, why);
    ASSERT_TRUE(card_) << why;
  }

  // What the card's sum is off the CPU's by.
  test::SumDifference difference(const Eye& eye) {
    const auto cpu = eye.renderer(nullptr), drawn = eye.renderer(card_.get());
    EXPECT_TRUE(drawn->drawing().drawn || drawn->rect().empty()) << drawn->drawing().why_not;
    return test::difference_of(eye.sum_of(*cpu), eye.sum_of(*drawn));
  }

  static std::vector<Image> images_of_family(const Rig& rig, Random& random, PixelFamily family) {
    const auto rgb = images_of(rig, random, reference::smooth_image);
    return family == PixelFamily::kI420 ? test::i420_of(rgb) : rgb;
  }

  std::shared_ptr<gl::SumDrawer> card_;
};

// Of apertures from less than a camera's distance to all of the array, and of 1 to 8 nearest cameras; planes and maps,
// lenses, borders, turned views, nodes of some cameras, cameras without an image.
TEST_F(BlendedViews, AreTheCpus) {
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420}) {
    test::SumDifference worst;
    size_t mended = 0;
    for (int seed = 0; seed < 20; seed++) {
      SCOPED_TRACE(seed);
      Random random(seed);
      const Rig rig = test::jittered_array(random, 4, 161, 120, seed % 3 ? -0.25 : 0);
      View view = test::view_into(rig, 4, 150 + seed % 5, 111, random.small_rotation(seed % 4 == 2 ? 0.5 : 0.1));
      view.blending = seed % 2 ? within(random.uniform(0.02, 0.5)) : nearest(random.integer(1, 8));
      if (seed % 5 < 2) view.focus.map = test::depths(random, view, 8, seed % 5 == 1);
      if (seed % 7 == 3) view.lens = Lens(LensModel::kSimpleRadial, {1.25 * view.width, 70, 50, -0.1});
      const std::vector<Image> images = images_of_family(rig, random, family);
      Eye eye(rig, build_mesh(rig), view, images, family);
      if (seed % 6 == 5) std::erase_if(eye.sources, [](const Source& source) { return source.camera % 3 == 0; });
      for (Source& source : eye.sources) {
        if (seed % 3 == 1 && source.camera % 5 == 2) source.image = {.family = PixelFamily::kNone};
      }
      worst.add(difference(eye));
      mended += card_->mended();
    }
    std::printf("%s: levels %.3f, lost %.2g, %zu mended\n", family == PixelFamily::kI420 ? "I420" : "RGB", worst.level,
                worst.lost, mended);
    EXPECT_LE(worst.level, 0.1);
    EXPECT_LE(worst.lost, 1.01 / kLostOne) << "the CPU knows no weight of all";
  }
}

// Nodes of which the sum begins anywhere, and of more cameras than a point of the grid has.
TEST_F(BlendedViews, NodesOfSomeCamerasAre) {
  int odd = 0;
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420}) {
    Random random(3);
    const Rig rig = test::jittered_array(random, 9, 97, 72, -0.2);
    View view = test::view_into(rig, 9, 150, 111, random.small_rotation(0.1));
    const std::vector<Image> images = images_of_family(rig, random, family);
    for (const Blending& blending : {within(0.2), within(1.3), nearest(6)}) {
      view.blending = blending;
      const Eye all(rig, build_mesh(rig), view, images, family);
      test::SumDifference worst = difference(all);
      for (int node = 0; node < 9; node++) {
        Eye eye = all;
        std::erase_if(eye.sources, [&](const Source& of) {
          return static_cast<int>(of.camera % 9) / 3 != node % 3 || static_cast<int>(of.camera / 27) != node / 3;
        });
        const Rect rect = eye.renderer(nullptr)->rect();
        odd += rect.x0 % 2 && rect.y0 % 2;
        worst.add(difference(eye));
      }
      EXPECT_LE(worst.level, 0.2);
      EXPECT_LE(worst.lost, 1.01 / kLostOne);
    }
  }
  EXPECT_GT(odd, 0);
}

// The eye at a camera, in the array's plane, and behind it; one camera; cameras at one place; a view from a camera's
// place, pixel for pixel, whose border the card can't tell.
TEST_F(BlendedViews, HardOnesAre) {
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420})
    for (const Blending& blending : {within(0.25), nearest(4)}) {
      test::SumDifference worst;
      size_t mended = 0;
      for (int hard = 0; hard < 6; hard++) {
        SCOPED_TRACE(hard);
        Random random(hard);
        Rig rig = test::jittered_array(random, 3, 161, 120, hard == 5 ? 0 : -0.2);
        View view = test::view_into(rig, 3, 201, 161, random.small_rotation(0.05));
        const Camera& middle = rig.cameras[4];
        if (hard == 0) view.pose.position = middle.pose.position;
        if (hard == 1) view.pose.position = {0.12, 0.07, 1e-12};
        if (hard == 2) view.pose.position.z = 0.4;
        if (hard == 3) rig.cameras[5].pose.position = rig.cameras[3].pose.position = middle.pose.position;
        if (hard == 5) {
          view.pose = middle.pose;
          view.lens = Lens::pinhole(middle.lens.fx(), middle.lens.cx() + 20.5, middle.lens.cy() + 20.5);
        }
        view.blending = blending;
        const std::vector<Image> images = images_of_family(rig, random, family);
        Eye eye(rig, build_mesh(rig), view, images, family);
        if (hard == 4) eye.sources.resize(1);
        worst.add(difference(eye));
        mended += card_->mended();
      }
      EXPECT_LE(worst.level, 0.1);
      EXPECT_LE(worst.lost, 1.01 / kLostOne);
      EXPECT_GT(mended, 100u);
    }
}

// Each is what it is alone, and with views that their mesh blends in the same call.
TEST_F(BlendedViews, GoInOnePass) {
  for (int seed = 0; seed < 4; seed++) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const PixelFamily family = seed % 2 ? PixelFamily::kI420 : PixelFamily::kRgb;
    const Rig rig = test::jittered_array(random, 4, 161, 120, -0.2);
    const std::vector<Image> images = images_of_family(rig, random, family);
    std::vector<std::unique_ptr<Eye>> eyes;
    for (int i = 0; i < 6; i++) {
      View view = test::view_into(rig, 4, random.integer(33, 150), random.integer(30, 120), random.small_rotation(0.1));
      if (seed > 1) view.focus.map = test::depths(random, view, 8, false);
      if (i < 4) view.blending = i % 2 ? within(0.15) : nearest(3);
      eyes.push_back(std::make_unique<Eye>(rig, build_mesh(rig), view, images, family));
    }
    std::vector<std::unique_ptr<SumRenderer>> together;
    std::vector<SumRenderer*> all;
    for (const auto& eye : eyes) all.push_back(together.emplace_back(eye->renderer(nullptr)).get());
    SumRenderer::draw(all, *card_, serial_for);
    EXPECT_EQ(card_->passes(), 2u);
    for (size_t i = 0; i < eyes.size(); i++) {
      const auto alone = eyes[i]->renderer(card_.get());
      ASSERT_TRUE(alone->drawing().drawn) << alone->drawing().why_not;
      EXPECT_TRUE(eyes[i]->sum_of(*together[i]) == eyes[i]->sum_of(*alone)) << i;
    }
  }
}

}  // namespace
}  // namespace lf
