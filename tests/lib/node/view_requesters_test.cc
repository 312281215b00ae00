// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/view_requesters.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

using RequesterPtr = std::shared_ptr<Node::Requester>;

TEST(ViewRequesters, EachViewKeepsItsOwn) {
  const Node::Requester common;
  ViewRequesters views(common);
  const RequesterPtr three = views.of(3);
  three->warned_of = 33;
  EXPECT_EQ(views.of(4)->warned_of, 0u);
  EXPECT_EQ(views.of(3), three);
  EXPECT_EQ(three->cancelled, common.cancelled) << "one flag for all of them";
  EXPECT_EQ(three->images, common.images);
  views.clear();
  EXPECT_EQ(views.of(3)->warned_of, 0u);
}

TEST(ViewRequesters, TheOneAskedForLongestAgoIsForgotten) {
  ViewRequesters views{Node::Requester()};
  for (uint32_t id = 0; id < 2 * ViewRequesters::kMostViews; id++) views.of(id)->warned_of = 1;
  views.of(0);
  views.of(1000);
  EXPECT_EQ(views.of(0)->warned_of, 1u);
  EXPECT_EQ(views.of(1)->warned_of, 0u);
}

TEST(ViewRequesters, WhatOneViewsAnswersTakeTellsNothingOfAnothers) {
  ViewRequesters views{Node::Requester()};
  views.of(1)->estimate.done(1000, 5000);
  EXPECT_EQ(views.nanoseconds(1, 100), 500u);
  EXPECT_EQ(views.nanoseconds(2, 100), 0u) << "not known";
  views.of(2);
  EXPECT_EQ(views.nanoseconds(2, 100), 0u);
}

// An answer may be left for those of any number of other views, and is taken up again.
TEST(ViewRequesters, WhatIsInUseStaysWhenItIsForgotten) {
  ViewRequesters views{Node::Requester()};
  RequesterPtr held = views.of(1);
  const std::weak_ptr<Node::Requester> watched = held;
  held->warned_of = 11;
  for (uint32_t id = 2; id < 2 + 3 * ViewRequesters::kMostViews; id++) views.of(id)->warned_of = id;
  ASSERT_FALSE(watched.expired());
  EXPECT_EQ(held->warned_of, 11u);
  EXPECT_NE(views.of(1), held) << "forgotten all the same";
  held.reset();
  EXPECT_TRUE(watched.expired());
}

}  // namespace
}  // namespace lf
