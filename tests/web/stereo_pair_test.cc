// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/stereo_pair.h"

#include <gst/gst.h>
#include <gst/video/video.h>
#include <gtest/gtest.h>

namespace lf::serve {
namespace {

constexpr int kWidth = 6, kHeight = 4;

// A picture of one colour.
GstSample* picture(GstClockTime stamp, guint8 luma) {
  GstVideoInfo info;
  gst_video_info_set_format(&info, GST_VIDEO_FORMAT_I420, kWidth, kHeight);
  GstBuffer* buffer = gst_buffer_new_allocate(nullptr, GST_VIDEO_INFO_SIZE(&info), nullptr);
  gst_buffer_memset(buffer, 0, luma, GST_VIDEO_INFO_SIZE(&info));
  GST_BUFFER_PTS(buffer) = stamp;
  GstCaps* caps = gst_video_info_to_caps(&info);
  GstSample* sample = gst_sample_new(buffer, caps, nullptr, nullptr);
  gst_buffer_unref(buffer);
  gst_caps_unref(caps);
  return sample;
}

class StereoPairTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { gst_init(nullptr, nullptr); }
  // Left and right luma of what comes out, checked pixel by pixel; nothing comes: {-1, -1}.
  std::pair<int, int> add(StereoPair::Side side, GstClockTime stamp, guint8 luma) {
    GstSample* both = pair_.add(side, picture(stamp, luma));
    if (!both) return {-1, -1};
    GstVideoInfo info;
    EXPECT_TRUE(gst_video_info_from_caps(&info, gst_sample_get_caps(both)));
    EXPECT_EQ(GST_VIDEO_INFO_WIDTH(&info), 2 * kWidth);
    EXPECT_EQ(GST_VIDEO_INFO_HEIGHT(&info), kHeight);
    EXPECT_EQ(GST_BUFFER_PTS(gst_sample_get_buffer(both)), stamp);
    GstVideoFrame frame;
    EXPECT_TRUE(gst_video_frame_map(&frame, &info, gst_sample_get_buffer(both), GST_MAP_READ));
    const auto at = [&](int component, int x, int y) {
      return static_cast<guint8*>(
          GST_VIDEO_FRAME_COMP_DATA(&frame, component))[y * GST_VIDEO_FRAME_COMP_STRIDE(&frame, component) + x];
    };
    const std::pair<int, int> values{at(0, 0, 0), at(0, kWidth, 0)};
    for (int c = 0; c < 3; c++)
      for (int y = 0; y < GST_VIDEO_FRAME_COMP_HEIGHT(&frame, c); y++)
        for (int x = 0; x < GST_VIDEO_FRAME_COMP_WIDTH(&frame, c); x++)
          EXPECT_EQ(at(c, x, y), 2 * x < GST_VIDEO_FRAME_COMP_WIDTH(&frame, c) ? values.first : values.second);
    gst_video_frame_unmap(&frame);
    gst_sample_unref(both);
    return values;
  }
  StereoPair pair_;
  const std::pair<int, int> none_{-1, -1};
};

TEST_F(StereoPairTest, JoinsPicturesOfOneMoment) {
  EXPECT_EQ(add(StereoPair::kLeft, 100, 10), none_);
  EXPECT_EQ(add(StereoPair::kRight, 100, 20), std::pair(10, 20));
  EXPECT_EQ(add(StereoPair::kRight, 200, 40), none_);
  EXPECT_EQ(add(StereoPair::kLeft, 200, 30), std::pair(30, 40));
}

TEST_F(StereoPairTest, LeavesOutWhatHasNoOtherHalf) {
  EXPECT_EQ(add(StereoPair::kLeft, 100, 1), none_);
  EXPECT_EQ(add(StereoPair::kRight, 101, 2), none_);
  EXPECT_EQ(add(StereoPair::kLeft, 200, 3), none_);
  EXPECT_EQ(add(StereoPair::kRight, 200, 4), std::pair(3, 4));
  EXPECT_EQ(add(StereoPair::kRight, 100, 5), none_) << "that moment is over";
  for (GstClockTime t = 300; t < 400; t++) EXPECT_EQ(add(StereoPair::kLeft, t, 6), none_);
  EXPECT_EQ(add(StereoPair::kRight, 399, 7), std::pair(6, 7));
}

}  // namespace
}  // namespace lf::serve
