// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/hole_filling.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace lf {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

std::vector<LinkPart> link_of_9(const std::vector<Triangle>& star) { return camera_link(star, 9); }

TEST(Link, RingAroundAnInnerCamera) {
  const auto link = link_of_9({{1, 2, 9}, {9, 3, 4}, {2, 3, 9}, {4, 1, 9}});
  ASSERT_THAT(link, SizeIs(1));
  EXPECT_TRUE(link[0].closed);
  EXPECT_THAT(link[0].camera, ElementsAre(1, 2, 3, 4));
}

TEST(Link, ChainAtTheBorderFromEndToEnd) {
  const auto link = link_of_9({{2, 3, 9}, {3, 4, 9}, {1, 2, 9}});
  ASSERT_THAT(link, SizeIs(1));
  EXPECT_FALSE(link[0].closed);
  EXPECT_THAT(link[0].camera, ElementsAre(1, 2, 3, 4));
}

TEST(Link, FirstTriangleSaysWhichWay) {
  EXPECT_THAT(link_of_9({{3, 2, 9}, {1, 2, 9}, {3, 4, 9}})[0].camera, ElementsAre(4, 3, 2, 1));
}

TEST(Link, TwoFansThatMeetInTheCameraAlone) {
  const auto link = link_of_9({{1, 2, 9}, {2, 3, 9}, {4, 5, 9}, {5, 6, 9}, {6, 4, 9}});
  ASSERT_THAT(link, SizeIs(2));
  EXPECT_THAT(link[0].camera, ElementsAre(1, 2, 3));
  EXPECT_FALSE(link[0].closed);
  EXPECT_THAT(link[1].camera, ElementsAre(4, 5, 6));
  EXPECT_TRUE(link[1].closed);
}

TEST(Link, NothingToFill) {
  EXPECT_THAT(link_of_9({}), IsEmpty());
  EXPECT_THAT(link_of_9({{1, 2, 9}}), IsEmpty());
  EXPECT_THAT(link_of_9({{1, 2, 9}, {1, 2, 9}}), IsEmpty());  // the same triangle twice
  EXPECT_THAT(link_of_9({{1, 1, 9}, {9, 9, 2}}), IsEmpty());  // repeated corners
}

TEST(Link, ThreeTrianglesAtOneEdgeAreNotASurface) {
  EXPECT_THAT(link_of_9({{1, 2, 9}, {2, 3, 9}, {2, 4, 9}}), IsEmpty());
}

}  // namespace
}  // namespace lf
