// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/view_chooser.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

BoardView at(double x, std::vector<int> ids = {0, 1, 2, 3}) {
  BoardView view{"", {}, ids};
  for (const int id : ids) view.corners.emplace_back(x + 20 * id, 100);
  return view;
}

TEST(ViewChooser, TakesABoardThatStandsStillSomewhereElse) {
  ViewChooser chooser(320);
  EXPECT_FALSE(chooser.take(at(50)));  // is it moving?
  EXPECT_TRUE(chooser.take(at(50.4)));
  EXPECT_FALSE(chooser.take(at(50.4)));  // as before
  EXPECT_FALSE(chooser.take(at(60)));    // moving
  EXPECT_FALSE(chooser.take(at(60)));    // still, but hardly elsewhere
  EXPECT_FALSE(chooser.take(at(90)));
  EXPECT_TRUE(chooser.take(at(90)));
}

TEST(ViewChooser, ComparesTheCornersThatBothShow) {
  ViewChooser chooser(320);
  EXPECT_FALSE(chooser.take(at(50)));
  EXPECT_TRUE(chooser.take(at(50)));
  EXPECT_FALSE(chooser.take(at(50, {2, 3, 4, 5})));  // the same place, another part
  EXPECT_FALSE(chooser.take(at(50, {6, 7})));        // nothing in common: is it moving?
  EXPECT_TRUE(chooser.take(at(50, {6, 7})));
}

}  // namespace
}  // namespace lf
