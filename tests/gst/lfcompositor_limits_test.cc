// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Answers that nobody has asked for, forged or of a viewer that has begun anew since, cost at most one picture.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "gst/compositor_live_fixture.h"

namespace lf::test {
namespace {

using testing::IsEmpty;

class CompositorLimitsTest : public LfCompositorLiveTest {
 protected:
  // A request, and what two nodes answer to it; complete?
  bool is_complete() {
    const uint64_t before = stat(element_.get(), "complete");
    const ViewRequest asked = ask();
    push(0, answer_of(asked, {0, 1}));
    push(1, answer_of(asked, {2, 3}));
    EXPECT_FALSE(pull().empty());
    return stat(element_.get(), "complete") == before + 1;
  }
  void begin() { start_live(2, {{"rig", array_.rig_path()}, {"max-missed", "2"}}); }
};

TEST_F(CompositorLimitsTest, AForgedAnswerCostsAtMostOnePicture) {
  begin();
  EXPECT_TRUE(is_complete());
  // As far ahead as can be, within reach, and of the request that comes next, with a time that it does not have.
  for (const uint32_t ahead : {uint32_t{1} << 30, 20u, 5u, 1u}) {
    ViewRequest forged = array_.request(sequence_ + ahead - 1, 77);
    push(0, answer_of(forged, {0, 1}, 30));
    int broken = 0;
    for (int i = 0; i < 8; i++) broken += !is_complete();
    EXPECT_LE(broken, 1) << ahead;
  }
  EXPECT_GT(stat(element_.get(), "stray-answers"), 0u);
  EXPECT_THAT(announced(), IsEmpty());
}

// Nobody has camera 900 (or 2 to 65534): who missed it would have it named in every request from then on, which every
// node refuses.
TEST_F(CompositorLimitsTest, AForgedAnswerOfCamerasThatNobodyHasCostsNothing) {
  begin();
  for (int i = 0; i < 2; i++) EXPECT_TRUE(is_complete());
  for (const CameraIndex first : {900u, 2u}) {
    for (const uint32_t behind : {0u, 1u}) {  // to the request that comes next, and to the one before
      const uint32_t number = sequence_ - behind;
      wire::Answer forged = answer_of(array_.request(number, kNow + number * kFrame), {0, 1});
      forged.fragments.clear();
      forged.cameras = {};
      forged.cameras.append({first, first == 900u ? first : kMaxCameras - 1});
      push(0, forged);
      for (int i = 0; i < 8; i++) EXPECT_TRUE(is_complete()) << first << ", " << behind;
    }
  }
  EXPECT_EQ(stat(element_.get(), "bad-answers"), 4u);
  EXPECT_THAT(announced(), IsEmpty());
}

TEST_F(CompositorLimitsTest, AnotherRigsAnswerCostsAtMostOnePicture) {
  begin();
  EXPECT_TRUE(is_complete());
  for (const uint32_t ahead : {0u, 3u}) {
    ViewRequest next = array_.request(sequence_ + ahead, kNow + (sequence_ + ahead) * kFrame);
    wire::Answer forged = answer_of(next, {0, 1}, 30);
    forged.rig_hash ^= 1;
    push(0, forged);
    int broken = 0;
    for (int i = 0; i < 5; i++) broken += !is_complete();
    EXPECT_LE(broken, 1) << ahead;
  }
  EXPECT_EQ(stat(element_.get(), "rig-mismatches"), 2u);
}

TEST_F(CompositorLimitsTest, AViewerThatBeginsAnewIsServedAtOnce) {
  begin();
  for (int i = 0; i < 12; i++) EXPECT_TRUE(is_complete());
  // Late answers of the one before, whose requests nobody has any more.
  for (uint32_t i = 0; i < 3; i++) push(0, answer_of(array_.request(sequence_ + i, 77), {0, 1}, 30));
  const uint32_t time = sequence_;
  for (uint32_t i = 0; i < 20; i++) {
    ViewRequest asked = array_.request(i, kNow + (time + i) * kFrame);
    gst_harness_set_time(harness_.get(), asked.target_time);
    request(asked);
    push(0, answer_of(asked, {0, 1}));
    push(1, answer_of(asked, {2, 3}));
    EXPECT_FALSE(pull().empty());
  }
  EXPECT_GE(stat(element_.get(), "complete"), 12u + 19u);
  EXPECT_THAT(announced(), IsEmpty());
}

TEST_F(CompositorLimitsTest, ItsOwnRequestsHaveLimitsToo) {
  begin();
  ViewRequest large = array_.request(sequence_++, kNow);
  large.view.width = large.view.height = kMaxImageSize;
  request(large);
  EXPECT_TRUE(is_complete());
  EXPECT_EQ(stat(element_.get(), "refused-pixels"), 1u);
}

TEST_F(CompositorLimitsTest, EachLimitIsAPropertyAndIsCounted) {
  begin();
  const auto expect_refused = [this](const ViewRequest& asked, const char* counter) {
    const uint64_t before = stat(element_.get(), counter), all = stat(element_.get(), "refused");
    request(asked);
    EXPECT_EQ(stat(element_.get(), counter), before + 1) << counter;
    EXPECT_EQ(stat(element_.get(), "refused"), all + 1) << counter;
  };
  const auto next = [this] {
    const uint32_t sequence = sequence_++;
    return array_.request(sequence, kNow + sequence * kFrame);
  };

  g_object_set(element_.get(), "max-pixels", guint64{100}, nullptr);
  expect_refused(next(), "refused-pixels");
  g_object_set(element_.get(), "max-pixels", guint64{1} << 22, nullptr);
  EXPECT_TRUE(is_complete());

  ViewRequest wide = next();
  wide.view.blending = {Blending::Kind::kAperture, 0.02, 0};
  g_object_set(element_.get(), "max-aperture", 0.01, nullptr);
  expect_refused(wide, "refused-aperture");

  ViewRequest curious = next();
  FocalMap map = FocalMap::for_view(curious.view.width, curious.view.height);
  map.from = {{0, 0, 1}, 0};
  map.farthest = 0.05;
  map.nearest = 0.3;
  map.levels.assign(static_cast<size_t>(map.columns) * map.rows, 51);
  curious.view.focus.map = std::make_shared<FocalMap>(std::move(map));
  curious.trials = {{Trial::Kind::kBlurred, 0}, {Trial::Kind::kPlane, 200}};
  g_object_set(element_.get(), "max-trials", 1u, nullptr);
  expect_refused(curious, "refused-trials");

  // Requests of one view that come at once: the first ones are the second's share.
  g_object_set(element_.get(), "max-requests-per-second", 5u, nullptr);
  for (int i = 0; i < 30; i++) {
    const uint64_t before = stat(element_.get(), "refused-rate");
    const ViewRequest asked = ask();
    if (stat(element_.get(), "refused-rate") > before) continue;
    push(0, answer_of(asked, {0, 1}));
    push(1, answer_of(asked, {2, 3}));
    EXPECT_FALSE(pull().empty()) << i;
  }
  EXPECT_GT(stat(element_.get(), "refused-rate"), 0u);
}

}  // namespace
}  // namespace lf::test
