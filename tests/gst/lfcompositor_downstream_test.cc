// SPDX-License-Identifier: LGPL-2.1-or-later
//
// What downstream says: which memory pictures are to be in and which formats it takes.
#include <gmock/gmock.h>
#include <gst/video/video.h>
#include <gtest/gtest.h>

#include "gst/compositor_fixture.h"

namespace lf::test {
namespace {

class LfCompositorDownstreamTest : public LfCompositorTest {
 protected:
  ~LfCompositorDownstreamTest() override {
    harness_.reset();
    gst_clear_object(&pool_);
  }

  // Downstream answers ALLOCATION queries with `pool_`, or not at all where `fails_`.
  void answer_allocation() {
    GstPad* src = gst_element_get_static_pad(element_.get(), "src");
    gst_pad_add_probe(src, static_cast<GstPadProbeType>(GST_PAD_PROBE_TYPE_QUERY_DOWNSTREAM | GST_PAD_PROBE_TYPE_PUSH),
                      on_query, this, nullptr);
    gst_object_unref(src);
  }

  BufferPtr picture(uint32_t sequence, PixelFamily family = PixelFamily::kRgb) {
    const ViewRequest asked = array_.request(sequence, sequence * kFrame);
    request(asked);
    push(0, answer_of(asked, {0, 1, 2, 3}, 200, family));
    return BufferPtr(gst_harness_pull(harness_.get()));
  }

  // A view that cameras do not see to its edges, and what a node has of it, with some texture.
  void ask_and_answer() {
    ViewRequest asked = array_.request(0, 0);
    asked.view.pose.position.x += 0.03;
    request(asked);
    wire::Answer answer = answer_of(asked, {0, 1, 2}, 200, PixelFamily::kI420);
    for (Fragment& fragment : answer.fragments)
      for (size_t i = 0; i < fragment.pixels.size(); i++) fragment.pixels[i] ^= static_cast<uint8_t>(i * 5 % 16);
    push(0, answer);
  }

  static GstPadProbeReturn on_query(GstPad*, GstPadProbeInfo* info, gpointer data) {
    auto* self = static_cast<LfCompositorDownstreamTest*>(data);
    GstQuery* query = GST_PAD_PROBE_INFO_QUERY(info);
    if (GST_QUERY_TYPE(query) != GST_QUERY_ALLOCATION) return GST_PAD_PROBE_OK;
    self->queries_++;
    if (self->fails_) return GST_PAD_PROBE_DROP;
    GstCaps* caps = nullptr;
    gst_query_parse_allocation(query, &caps, nullptr);
    GstVideoInfo info_of_caps;
    if (!caps || !gst_video_info_from_caps(&info_of_caps, caps)) return GST_PAD_PROBE_DROP;
    gst_query_add_allocation_pool(query, self->pool_, static_cast<guint>(info_of_caps.size), 0, self->most_);
    gst_query_add_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr);
    return GST_PAD_PROBE_HANDLED;
  }

  GstBufferPool* pool_ = gst_video_buffer_pool_new();
  guint most_ = 0;
  bool fails_ = false;
  int queries_ = 0;
};

TEST_F(LfCompositorDownstreamTest, PicturesAreInTheMemoryThatIsOffered) {
  start(1);
  answer_allocation();
  for (uint32_t i = 0; i < 20; i++) EXPECT_EQ(picture(i)->pool, pool_) << i;
  EXPECT_EQ(queries_, 1);
}

TEST_F(LfCompositorDownstreamTest, PicturesAreTheSameInAnyMemory) {
  start(1);
  const std::vector<uint8_t> plain = to_bytes(picture(0).get());
  nodes_.clear();
  start(1);
  answer_allocation();
  EXPECT_EQ(to_bytes(picture(0).get()), plain);
}

TEST_F(LfCompositorDownstreamTest, APoolThatRunsOutHoldsNobodyUp) {
  start(1);
  most_ = 2;
  answer_allocation();
  std::vector<BufferPtr> kept;
  for (uint32_t i = 0; i < 8; i++) kept.push_back(picture(i));
  EXPECT_EQ(std::ranges::count_if(kept, [&](const BufferPtr& b) { return b->pool == pool_; }), 2);
}

TEST_F(LfCompositorDownstreamTest, WhoOffersNoneGetsPicturesAllTheSame) {
  start(1);
  fails_ = true;
  answer_allocation();
  for (uint32_t i = 0; i < 5; i++) EXPECT_NE(picture(i), nullptr);
  EXPECT_EQ(queries_, 1);
}

TEST_F(LfCompositorDownstreamTest, WhatChangesDownstreamIsAskedForAgain) {
  start(1);
  fails_ = true;
  answer_allocation();
  EXPECT_NE(picture(0)->pool, pool_);
  fails_ = false;
  gst_harness_push_upstream_event(harness_.get(), gst_event_new_reconfigure());
  EXPECT_EQ(picture(1)->pool, pool_);
  gst_harness_push_upstream_event(harness_.get(), gst_event_new_reconfigure());
  EXPECT_EQ(picture(2)->pool, pool_) << "the same pool, which is in use";
  EXPECT_EQ(queries_, 3);
}

TEST_F(LfCompositorDownstreamTest, TheNextRunAsksAgain) {
  start(1);
  answer_allocation();
  EXPECT_EQ(picture(0)->pool, pool_);
  EXPECT_TRUE(gst_buffer_pool_is_active(pool_));
  gst_element_set_state(element_.get(), GST_STATE_NULL);
  EXPECT_FALSE(gst_buffer_pool_is_active(pool_));
}

TEST_F(LfCompositorDownstreamTest, PartialAnswersHaveCapsAndMemoryOfTheirOwn) {
  start(1, {{"rig", array_.rig_path()}, {"partial", "true"}});
  answer_allocation();
  const BufferPtr answer = picture(0);
  EXPECT_EQ(answer->pool, nullptr);
  EXPECT_EQ(caps_of(harness_->sinkpad), "application/x-lightfield-answer, parsed=(boolean)true");
}

// The picture's bytes, row by row without padding, with chroma as planes.
std::vector<uint8_t> planar(GstBuffer* buffer, const GstVideoInfo& info) {
  GstVideoFrame frame;
  EXPECT_TRUE(gst_video_frame_map(&frame, &info, buffer, GST_MAP_READ));
  std::vector<uint8_t> bytes;
  for (guint c = 0; c < 3; c++)
    for (gint y = 0; y < GST_VIDEO_FRAME_COMP_HEIGHT(&frame, c); y++)
      for (gint x = 0; x < GST_VIDEO_FRAME_COMP_WIDTH(&frame, c); x++)
        bytes.push_back(static_cast<const uint8_t*>(GST_VIDEO_FRAME_COMP_DATA(
            &frame, c))[y * GST_VIDEO_FRAME_COMP_STRIDE(&frame, c) + x * GST_VIDEO_FRAME_COMP_PSTRIDE(&frame, c)]);
  gst_video_frame_unmap(&frame);
  return bytes;
}

TEST_F(LfCompositorDownstreamTest, Nv12IsI420InAnotherLayout) {
  std::vector<uint8_t> pictures[2];
  for (const bool nv12 : {false, true}) {
    nodes_.clear();
    start(1, {{"background", "0xff4080c0"}}, nv12 ? "video/x-raw,format=NV12" : "video/x-raw,format=I420");
    ask_and_answer();
    const BufferPtr picture(gst_harness_pull(harness_.get()));
    EXPECT_EQ(output_format(), nv12 ? "NV12" : "I420");
    const CapsPtr caps(gst_pad_get_current_caps(harness_->sinkpad));
    GstVideoInfo info;
    ASSERT_TRUE(gst_video_info_from_caps(&info, caps.get()));
    EXPECT_EQ(info.colorimetry.range, GST_VIDEO_COLOR_RANGE_0_255);
    EXPECT_EQ(info.colorimetry.matrix, GST_VIDEO_COLOR_MATRIX_BT601);
    pictures[nv12] = planar(picture.get(), info);
  }
  EXPECT_EQ(pictures[0], pictures[1]);
  EXPECT_NE(std::ranges::min(pictures[0]), std::ranges::max(pictures[0]));
}

// Of the same sums, within what rounding makes of both.
TEST_F(LfCompositorDownstreamTest, VideoHasTheRangeThatIsAskedFor) {
  std::vector<uint8_t> pictures[2];
  for (const bool video : {false, true}) {
    nodes_.clear();
    start(1, {{"background", "0xff4080c0"}},
          video ? "video/x-raw,format=I420,colorimetry=bt601; video/x-raw" : "video/x-raw");
    ask_and_answer();
    const BufferPtr picture(gst_harness_pull(harness_.get()));
    const CapsPtr caps(gst_pad_get_current_caps(harness_->sinkpad));
    GstVideoInfo info;
    ASSERT_TRUE(gst_video_info_from_caps(&info, caps.get()));
    EXPECT_EQ(info.colorimetry.range, video ? GST_VIDEO_COLOR_RANGE_16_235 : GST_VIDEO_COLOR_RANGE_0_255);
    EXPECT_EQ(info.colorimetry.matrix, GST_VIDEO_COLOR_MATRIX_BT601);
    pictures[video] = planar(picture.get(), info);
  }
  const size_t luma = pictures[0].size() / 3 * 2;
  ASSERT_EQ(pictures[0].size(), pictures[1].size());
  for (size_t i = 0; i < pictures[0].size(); i++) {
    const int full = pictures[0][i];
    ASSERT_NEAR(pictures[1][i], i < luma ? 16 + full * 219 / 255. : 128 + (full - 128) * 224 / 255., 0.95) << i;
  }
}

TEST_F(LfCompositorDownstreamTest, WhoTakesBothGetsPlanes) {
  start(1, {}, "video/x-raw,format={ NV12, I420 }");
  EXPECT_NE(picture(0, PixelFamily::kI420), nullptr);
  EXPECT_EQ(output_format(), "I420");
}

}  // namespace
}  // namespace lf::test
