// SPDX-License-Identifier: LGPL-2.1-or-later
#include "reference/float_still.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "base/error.h"
#include "composite/still.h"
#include "reference/exact_quality.h"
#include "rig/rig.h"

namespace lf {
namespace {

// 2x2 cameras that look at a plane 2 m away; the view may look past their images.
class FloatStillTest : public testing::Test {
 protected:
  FloatStillTest() : rig_(make_grid_rig({2, 2, 0.2, 50, 40, 30})), mesh_(build_mesh(rig_)) {
    view_.width = 31;  // odd: chroma reaches over the edge
    view_.height = 25;
    view_.lens = Lens::from_fov_y(40, view_.width, view_.height);
    view_.pose.position = {0, 0, 0.1};
    view_.focus.plane = plane_through({0, 0, 2}, {0, 0, -1});
  }

  Image image(PixelFamily family, CameraIndex camera) const {
    Image image(family, 40, 30);
    for (size_t i = 0; i < image.data().size(); i++) image.data()[i] = static_cast<uint8_t>(i * (7 + camera) % 251);
    return image;
  }
  CameraImages images(PixelFamily family) const {
    return [this, family, kept = Image()](CameraIndex camera) mutable -> const Image& {
      return kept = image(family, camera);
    };
  }
  FloatStill exact(PixelFamily family) const {
    const ViewPlan plan(rig_, mesh_, view_);
    return render_float_still(rig_, plan, OwnerMap(plan, {0, 0, view_.width, view_.height}), family, images(family));
  }

  Rig rig_;
  Mesh mesh_;
  View view_;
};

TEST_F(FloatStillTest, AStillIsItsRounding) {
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420}) {
    const Still still = render_still(rig_, mesh_, view_, images(family));
    const ExactQuality quality = compare(still.picture, exact(family));
    EXPECT_LE(quality.max_error, 1);
    EXPECT_GT(quality.max_error, 0);
    EXPECT_GT(quality.psnr_db, 55);
    EXPECT_GT(quality.coverage, 0.8);
  }
}

TEST_F(FloatStillTest, WhatIsLostIsDividedAwayInEveryPlane) {
  view_.lens = Lens::from_fov_y(58, view_.width, view_.height);  // beyond the cameras' images
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420}) {
    const ViewPlan plan(rig_, mesh_, view_);
    Image grey(family, 40, 30);
    std::fill(grey.data().begin(), grey.data().end(), uint8_t{77});
    const FloatStill still = render_float_still(rig_, plan, OwnerMap(plan, {0, 0, view_.width, view_.height}), family,
                                                [&](CameraIndex) -> const Image& { return grey; });
    ASSERT_GT(*std::max_element(still.lost.begin(), still.lost.end()), 0.1);
    const size_t pixels = still.valid.size();
    for (size_t i = 0; i < pixels; i++) {
      ASSERT_NEAR(still.valid[i] + still.lost[i], 1, 1e-6);
      if (still.valid[i] < 0.01) continue;
      ASSERT_NEAR(still.colour[family == PixelFamily::kRgb ? 3 * i : i], 77, 1e-3);
    }
    if (family == PixelFamily::kRgb) continue;
    for (size_t i = pixels; i < still.colour.size(); i++)
      if (std::abs(still.colour[i] - 128) > 1e-6) {  // else nothing is left of it
        ASSERT_NEAR(still.colour[i], 77, 1e-3);
      }
  }
}

TEST_F(FloatStillTest, ImagesOfAnotherFamilyAreAnError) {
  const ViewPlan plan(rig_, mesh_, view_);
  const OwnerMap owners(plan, {0, 0, view_.width, view_.height});
  EXPECT_THROW(render_float_still(rig_, plan, owners, PixelFamily::kI420, images(PixelFamily::kRgb)), Error);
}

}  // namespace
}  // namespace lf
