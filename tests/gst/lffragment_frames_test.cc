// SPDX-License-Identifier: LGPL-2.1-or-later
// Which frame of each camera an answer shows, and how long it is waited for.
#include <gtest/gtest.h>

#include <thread>

#include "gst/fragment_fixture.h"

namespace lf::test {
namespace {

TEST_F(LfFragmentTest, TakesTheFrameNearestToTheRequestedTime) {
  start(4);
  push_frames(10, 0);
  push_frames(250, kFrame);
  const ViewRequest early = array_.request(0, kFrame * 4 / 10), late = array_.request(1, kFrame * 6 / 10);
  ASSERT_EQ(request(early), GST_FLOW_OK);
  const wire::Answer first = pull();
  EXPECT_EQ(first.actual_time, 0u);
  EXPECT_LE(picture_range(early, first).second, 11);
  ASSERT_EQ(request(late), GST_FLOW_OK);
  const wire::Answer second = pull();
  EXPECT_EQ(second.actual_time, kFrame);
  EXPECT_GE(picture_range(late, second).first, 248);
}

TEST_F(LfFragmentTest, WaitsForTheFrameOfAFile) {
  start(4);
  push_frames(10, 0);
  std::thread cameras([this] {
    g_usleep(50000);
    push_frames(90, kFrame);
  });
  ASSERT_EQ(request(array_.request(0, kFrame)), GST_FLOW_OK);
  cameras.join();
  EXPECT_EQ(pull().actual_time, kFrame);
}

TEST_F(LfFragmentTest, WaitsForCamerasThatHaveNotBegun) {
  start(3);
  const HarnessPtr late(gst_harness_new_with_element(element_.get(), "sink_3", nullptr));
  gst_harness_set_live(late.get(), FALSE);
  push_frames(60, 0);
  std::thread camera([&late] {
    g_usleep(50000);
    gst_harness_set_src_caps_str(late.get(), ArrayFixture::caps("RGB").c_str());
    gst_harness_push(late.get(), ArrayFixture::frame("RGB", 60, 0));
  });
  ASSERT_EQ(request(array_.request(0, 0)), GST_FLOW_OK);
  camera.join();
  EXPECT_EQ(pull().fragments.size(), 4u);
}

TEST_F(LfFragmentTest, FilesAreReadNoFasterThanRequestsMoveOn) {
  start(1);
  std::atomic<int> pushed{0};
  std::thread camera([this, &pushed] {
    for (int i = 0; i < 6; i++, pushed++)
      ASSERT_EQ(gst_harness_push(cameras_[0].get(), ArrayFixture::frame("RGB", 9, static_cast<uint64_t>(i) * kFrame)),
                GST_FLOW_OK);
  });
  g_usleep(100000);
  EXPECT_LE(pushed, 2);
  ASSERT_EQ(request(array_.request(0, 5 * kFrame)), GST_FLOW_OK);
  camera.join();
  EXPECT_EQ(pull().actual_time, 5 * kFrame);
}

TEST_F(LfFragmentTest, TheLastFrameOfAFileStands) {
  start(4);
  push_frames(10, 0);
  for (const HarnessPtr& camera : cameras_) gst_harness_push_event(camera.get(), gst_event_new_eos());
  ASSERT_EQ(request(array_.request(0, 50 * kFrame)), GST_FLOW_OK);
  const wire::Answer answer = pull();
  EXPECT_EQ(answer.fragments.size(), 4u);
  EXPECT_EQ(answer.actual_time, 0u);
}

TEST_F(LfFragmentTest, LiveCamerasAreNeverWaitedFor) {
  start(4, "RGB", true);
  set("max-skew", "0");
  for (int i = 0; i < 20; i++) push_frames(static_cast<uint8_t>(i), static_cast<uint64_t>(i) * kFrame);
  ASSERT_EQ(request(array_.request(0, 100 * kFrame)), GST_FLOW_OK);
  EXPECT_EQ(pull().actual_time, 19 * kFrame);
  ASSERT_EQ(request(array_.request(1, 18 * kFrame)), GST_FLOW_OK);  // the latest few are kept
  EXPECT_EQ(pull().actual_time, 18 * kFrame);
}

TEST_F(LfFragmentTest, ShutsDownWhileARequestWaits) {
  start(4);
  std::thread requester([this] { request(array_.request(0, kFrame)); });
  g_usleep(30000);
  gst_element_set_state(element_.get(), GST_STATE_NULL);
  requester.join();
}

}  // namespace
}  // namespace lf::test
