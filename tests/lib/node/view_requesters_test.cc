// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/view_requesters.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

TEST(ViewRequesters, EachViewKeepsItsOwn) {
  const auto cancelled = std::make_shared<std::atomic<bool>>(false);
  ViewRequesters views(cancelled);
  Node::Requester& three = views.of(3);
  three.warned_of = 33;
  EXPECT_EQ(views.of(4).warned_of, 0u);
  EXPECT_EQ(&views.of(3), &three);
  EXPECT_EQ(three.cancelled, cancelled) << "one flag for all of them";
  views.clear();
  EXPECT_EQ(views.of(3).warned_of, 0u);
}

TEST(ViewRequesters, TheOneAskedForLongestAgoIsForgotten) {
  ViewRequesters views(std::make_shared<std::atomic<bool>>(false));
  for (uint32_t id = 0; id < 2 * ViewRequesters::kMostViews; id++) views.of(id).warned_of = 1;
  views.of(0);
  views.of(1000);
  EXPECT_EQ(views.of(0).warned_of, 1u);
  EXPECT_EQ(views.of(1).warned_of, 0u);
}

}  // namespace
}  // namespace lf
