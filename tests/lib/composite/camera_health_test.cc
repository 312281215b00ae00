// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/camera_health.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

const CameraRanges kAll(CameraSet{0, 1, 2, 3}), kSome(CameraSet{0, 2, 3});

TEST(CameraHealth, ACameraThatStopsIsTakenOutAndComesBack) {
  CameraHealth health(2);
  for (int i = 0; i < 10; i++) EXPECT_FALSE(health.picture(kAll));
  EXPECT_FALSE(health.picture(kSome));
  EXPECT_FALSE(health.picture(kSome));
  EXPECT_TRUE(health.out_of_service().empty());
  EXPECT_TRUE(health.picture(kSome));
  EXPECT_EQ(health.out_of_service(), CameraSet{1});
  EXPECT_FALSE(health.picture(kSome));
  for (unsigned i = 1; i < CameraHealth::kBackAfter; i++) EXPECT_FALSE(health.picture(kAll));
  EXPECT_EQ(health.out_of_service(), CameraSet{1});
  EXPECT_TRUE(health.picture(kAll));
  EXPECT_TRUE(health.out_of_service().empty());
}

TEST(CameraHealth, OneThatComesAndGoesIsForgivenWhileItIsInAndStaysOutOnceItIsOut) {
  CameraHealth health(2);
  health.picture(kAll);
  for (int i = 0; i < 20; i++) EXPECT_FALSE(health.picture(i % 3 ? kSome : kAll)) << i;
  for (int i = 0; i < 3; i++) health.picture(kSome);
  EXPECT_EQ(health.out_of_service(), CameraSet{1});
  for (int i = 0; i < 20; i++) EXPECT_FALSE(health.picture(i % 3 ? kAll : kSome)) << i;
}

TEST(CameraHealth, OnlyKnownCamerasAreMissed) {
  CameraHealth without_rig(1), with_rig(1);
  with_rig.expect(4);
  for (int i = 0; i < 3; i++) {
    without_rig.picture(kSome);
    with_rig.picture(kSome);
  }
  EXPECT_TRUE(without_rig.out_of_service().empty());
  EXPECT_EQ(with_rig.out_of_service(), CameraSet{1});
}

TEST(CameraHealth, APictureOfNoneSaysNothingAboutCameras) {
  CameraHealth health(1);
  health.picture(kAll);
  for (int i = 0; i < 10; i++) EXPECT_FALSE(health.picture({}));
}

TEST(CameraHealth, NoneIsTakenOutUnlessAsked) {
  CameraHealth health;
  health.expect(4);
  for (int i = 0; i < 100; i++) EXPECT_FALSE(health.picture(kSome));
}

TEST(CameraHealth, AnAnswerInTimeButAfterItsPictureCountsForTheNext) {
  CameraHealth health(1);
  health.picture(kAll);
  for (int i = 0; i < 10; i++) {
    health.seen_late(0, CameraRanges(CameraSet{1}));
    EXPECT_FALSE(health.picture(kSome)) << i;
  }
  health.picture(kSome);
  EXPECT_TRUE(health.picture(kSome)) << "it counts once";
}

TEST(CameraHealth, AnotherRigHasOtherCameras) {
  CameraHealth health(1);
  health.expect(4);
  EXPECT_FALSE(health.use_rig(7)) << "the first";
  for (int i = 0; i < 3; i++) health.picture(kSome);
  EXPECT_EQ(health.out_of_service(), CameraSet{1});
  EXPECT_FALSE(health.use_rig(0)) << "not known";
  EXPECT_FALSE(health.use_rig(7));
  EXPECT_EQ(health.out_of_service(), CameraSet{1});
  EXPECT_TRUE(health.use_rig(8));
  EXPECT_TRUE(health.out_of_service().empty());
  EXPECT_FALSE(health.picture(kSome));
  EXPECT_TRUE(health.picture(kSome)) << "those that are expected are missed from the beginning";
  EXPECT_TRUE(health.use_rig(9));
  EXPECT_FALSE(health.use_rig(10)) << "nobody was out";
  health.seen_late(9, CameraRanges(CameraSet{1}));
  EXPECT_FALSE(health.picture(kSome));
  EXPECT_TRUE(health.picture(kSome)) << "what another rig's camera saw says nothing";
}

}  // namespace
}  // namespace lf
