// SPDX-License-Identifier: LGPL-2.1-or-later
// Which frame of each camera an answer shows, and how long it is waited for.
#include <gst/video/video.h>
#include <gtest/gtest.h>

#include <thread>

#include "gst/fragment_fixture.h"
#include "support/seeing.h"

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
  EXPECT_EQ(seeing(pull()).size(), 4u);
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
  EXPECT_EQ(seeing(answer).size(), 4u);
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

// As V4L2 has it: a camera whose few buffers are all held elsewhere stands still.
TEST_F(LfFragmentTest, ACameraWithAFixedPoolNeverRunsOutOfBuffers) {
  for (const guint size : {3u, 4u, 8u, 32u}) {
    cameras_.clear();
    start(1, "RGB", true);
    GstBufferPool* pool = gst_buffer_pool_new();
    const BufferPtr picture(ArrayFixture::frame("RGB", 77, 0));
    GstStructure* config = gst_buffer_pool_get_config(pool);
    const CapsPtr caps(gst_caps_from_string(ArrayFixture::caps("RGB").c_str()));
    gst_buffer_pool_config_set_params(config, caps.get(), static_cast<guint>(gst_buffer_get_size(picture.get())), size,
                                      size);
    ASSERT_TRUE(gst_buffer_pool_set_config(pool, config));
    ASSERT_TRUE(gst_buffer_pool_set_active(pool, TRUE));
    GstBufferPoolAcquireParams dont_wait{};
    dont_wait.flags = GST_BUFFER_POOL_ACQUIRE_FLAG_DONTWAIT;
    for (uint64_t i = 0; i < 40; i++) {
      GstBuffer* buffer = nullptr;
      ASSERT_EQ(gst_buffer_pool_acquire_buffer(pool, &buffer, &dont_wait), GST_FLOW_OK)
          << "all " << size << " are held after " << i << " frames";
      gst_buffer_fill(buffer, 0, to_bytes(picture.get()).data(), gst_buffer_get_size(picture.get()));
      GST_BUFFER_PTS(buffer) = i * kFrame;
      ASSERT_EQ(gst_harness_push(cameras_[0].get(), buffer), GST_FLOW_OK);
    }
    const ViewRequest asked = array_.request(0, 37 * kFrame);
    ASSERT_EQ(request(asked), GST_FLOW_OK);
    const wire::Answer answer = pull();
    EXPECT_EQ(answer.actual_time, 37 * kFrame) << "frames are what they were, copied or not";
    gst_buffer_pool_set_active(pool, FALSE);
    gst_object_unref(pool);
  }
}

TEST_F(LfFragmentTest, AnAllocationAnswerSaysHowManyFramesAreKept) {
  for (const bool live : {true, false}) {
    cameras_.clear();
    start(1, "RGB", live);
    const CapsPtr caps(gst_caps_from_string(ArrayFixture::caps("RGB").c_str()));
    GstQuery* query = gst_query_new_allocation(caps.get(), TRUE);
    ASSERT_TRUE(gst_pad_peer_query(cameras_[0]->srcpad, query));
    ASSERT_EQ(gst_query_get_n_allocation_pools(query), 1u);
    GstBufferPool* pool = nullptr;
    guint size = 0, least = 0, most = 1;
    gst_query_parse_nth_allocation_pool(query, 0, &pool, &size, &least, &most);
    EXPECT_FALSE(pool);
    EXPECT_EQ(least, live ? 5u : 3u);
    EXPECT_EQ(most, 0u);
    EXPECT_TRUE(gst_query_find_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr));
    gst_query_unref(query);
  }
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
