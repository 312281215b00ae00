// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gst/video/video.h>

#include "gst/gst_test.h"
#include "view/view.h"

namespace lf::test {
namespace {

constexpr int kColumns = 3, kRows = 2, kWidth = 48, kHeight = 24;
const LenticularDisplay kDisplay{.lens_pitch = 5.5, .slant = -11, .centre = 0.25};
const LenticularDisplay kReversed{.lens_pitch = 5.5, .slant = -11, .centre = 0.25, .reversed = true};

GstCaps* rgb(int width, int height) {
  return gst_caps_new_simple("video/x-raw", "format", G_TYPE_STRING, "RGB", "width", G_TYPE_INT, width, "height",
                             G_TYPE_INT, height, "framerate", GST_TYPE_FRACTION, 15, 1, nullptr);
}

class LfLenticular : public testing::Test {
 protected:
  void SetUp() override {
    harness_ = gst_harness_new("lflenticular");
    g_object_set(harness_->element, "columns", kColumns, "rows", kRows, "lens-pitch", kDisplay.lens_pitch, "slant",
                 kDisplay.slant, "centre", kDisplay.centre, nullptr);
    quilt_ = Image(PixelFamily::kRgb, kWidth, kHeight);
    for (size_t i = 0; i < quilt_.data().size(); i++) quilt_.data()[i] = static_cast<uint8_t>(i * 37 + i / 144 * 11);
  }
  void TearDown() override { gst_harness_teardown(harness_); }

  GstFlowReturn push() {
    gst_harness_set_src_caps(harness_, rgb(kWidth, kHeight));
    GstBuffer* buffer = to_buffer(quilt_.data());
    GST_BUFFER_PTS(buffer) = 5 * GST_SECOND;
    return gst_harness_push(harness_, buffer);
  }
  void expect_picture(int width, int height, const LenticularDisplay& display = kDisplay) {
    const BufferPtr out(gst_harness_pull(harness_));
    ASSERT_TRUE(out);
    EXPECT_EQ(GST_BUFFER_PTS(out.get()), 5 * GST_SECOND);
    GstVideoInfo info;
    gst_video_info_set_format(&info, GST_VIDEO_FORMAT_RGB, width, height);
    const std::vector<uint8_t> bytes = to_bytes(out.get());
    ASSERT_EQ(bytes.size(), GST_VIDEO_INFO_SIZE(&info));
    const ptrdiff_t stride = GST_VIDEO_INFO_PLANE_STRIDE(&info, 0);
    std::vector<uint8_t> expected(GST_VIDEO_INFO_SIZE(&info));
    interleave_views(display, {quilt_.view(), kColumns, kRows}, width, height, stride, expected.data());
    for (int y = 0; y < height; y++)
      EXPECT_TRUE(std::equal(&bytes[y * stride], &bytes[y * stride] + 3 * width, &expected[y * stride])) << y;
  }

  GstHarness* harness_ = nullptr;
  Image quilt_;
};

TEST_F(LfLenticular, FillsTheRequestedDisplay) {
  gst_harness_set_sink_caps(harness_, rgb(83, 41));
  EXPECT_EQ(push(), GST_FLOW_OK);
  expect_picture(83, 41);
}

TEST_F(LfLenticular, ReversesStripes) {
  g_object_set(harness_->element, "reversed", TRUE, nullptr);
  gst_harness_set_sink_caps(harness_, rgb(83, 41));
  EXPECT_EQ(push(), GST_FLOW_OK);
  expect_picture(83, 41, kReversed);
}

TEST_F(LfLenticular, OutputHasTheSizeOfAViewByDefault) {
  EXPECT_EQ(push(), GST_FLOW_OK);
  expect_picture(kWidth / kColumns, kHeight / kRows);
}

TEST_F(LfLenticular, WrongQuiltSizeIsAnError) {
  g_object_set(harness_->element, "columns", 5, nullptr);
  const ElementBus bus(harness_->element);
  EXPECT_EQ(push(), GST_FLOW_ERROR);
  EXPECT_THAT(bus.errors(), ElementsAre(mentions("48x24", "5 columns", "2 rows")));
}

}  // namespace
}  // namespace lf::test
