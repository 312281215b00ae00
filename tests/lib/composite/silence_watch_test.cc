// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/silence_watch.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

constexpr int64_t kEnough = SilenceWatch::kPatience;

TEST(SilenceWatch, RequestsOfOtherViewsAloneAreToldOfOnce) {
  SilenceWatch watch;
  EXPECT_FALSE(watch.others_asked(1));
  EXPECT_FALSE(watch.others_asked(kEnough));
  EXPECT_TRUE(watch.others_asked(1 + kEnough));
  EXPECT_FALSE(watch.others_asked(2 + 2 * kEnough));
  watch.clear();
  EXPECT_FALSE(watch.others_asked(3 * kEnough)) << "it begins anew";
  watch.asked();
  EXPECT_FALSE(watch.others_asked(9 * kEnough)) << "somebody asks";
}

TEST(SilenceWatch, AViewThatNobodyAnswersIsToldOfOnce) {
  SilenceWatch watch;
  EXPECT_FALSE(watch.composed(1));
  EXPECT_FALSE(watch.composed(kEnough));
  EXPECT_TRUE(watch.composed(1 + kEnough));
  EXPECT_FALSE(watch.composed(2 + 2 * kEnough));
  watch.clear();
  EXPECT_FALSE(watch.composed(3 * kEnough));
  watch.answered();
  EXPECT_FALSE(watch.composed(9 * kEnough));
}

}  // namespace
}  // namespace lf
