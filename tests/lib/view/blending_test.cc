// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/view.h"

#include <limits>

#include <gtest/gtest.h>

#include "support/expect_error.h"

namespace lf {
namespace {

using Kind = Blending::Kind;

TEST(Blending, IsByTheMeshUnlessSaidOtherwise) {
  EXPECT_TRUE(Blending{}.is_mesh());
  EXPECT_NO_THROW(validate(Blending{}));
}

TEST(Blending, IsByTheApertureIfThereIsOne) {
  EXPECT_EQ(blending_of(0, 0), Blending{});
  EXPECT_EQ(blending_of(0.2, 0), (Blending{Kind::kAperture, 0.2, 0}));
  EXPECT_EQ(blending_of(0.2, 4), (Blending{Kind::kAperture, 0.2, 0}));
  EXPECT_EQ(blending_of(0, 4), (Blending{Kind::kAngle, 0, 4}));
}

TEST(Blending, HasWhatItsKindKnows) {
  EXPECT_NO_THROW(validate({Kind::kAperture, 1e-9, 0}));
  EXPECT_NO_THROW(validate({Kind::kAperture, Blending::kMaxAperture, 0}));
  EXPECT_NO_THROW(validate({Kind::kAngle, 0, 1}));
  EXPECT_NO_THROW(validate({Kind::kAngle, 0, Blending::kMaxNearest}));
  for (const double bad : {0., -1., 1.1e6, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_ERROR(validate({Kind::kAperture, bad, 0}), "blending: the aperture must be above 0");
  for (const int bad : {0, -1, Blending::kMaxNearest + 1})
    EXPECT_ERROR(validate({Kind::kAngle, 0, bad}), "blending: must be of the nearest 1 to 32 cameras");
  EXPECT_ERROR(validate({Kind::kMesh, 0.1, 0}), "blending: has an aperture");
  EXPECT_ERROR(validate({Kind::kAperture, 0.1, 2}), "blending: has a number of cameras");
}

}  // namespace
}  // namespace lf
