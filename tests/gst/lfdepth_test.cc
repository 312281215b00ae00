// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gst/video/video.h>

#include "compositor/view_meta.h"
#include "gst/gst_test.h"
#include "view/depth_image.h"

namespace lf::test {
namespace {

constexpr int kWidth = 61, kHeight = 35;

GstCaps* caps_of(const char* format, int width = kWidth, int height = kHeight) {
  return gst_caps_new_simple("video/x-raw", "format", G_TYPE_STRING, format, "width", G_TYPE_INT, width, "height",
                             G_TYPE_INT, height, "framerate", GST_TYPE_FRACTION, 15, 1, nullptr);
}

class LfDepthTest : public testing::Test {
 protected:
  void SetUp() override {
    register_view_meta();
    harness_ = gst_harness_new("lfdepth");
    request_.view_id = 1;
    View& view = request_.view;
    view.width = kWidth;
    view.height = kHeight;
    view.lens = Lens(LensModel::kRadial, {70, 29, 18, -0.1, 0.01});
    view.pose = {{0.3, -0.2, -0.5}, glm::normalize(Quat(1, 0.1, -0.2, 0.05))};
    view.focus.plane = plane_through({0, 0, 2}, glm::normalize(Vec3(0.2, 0.1, 1)));
    FocalMap map = FocalMap::for_view(kWidth, kHeight);
    map.from = plane_through({0, 0, 0}, {0, 0, 1});
    map.farthest = 0;
    map.nearest = 0.8;
    for (int i = 0; i < map.columns * map.rows; i++) map.levels.push_back(static_cast<uint8_t>(31 * i));
    view.focus.map = std::make_shared<const FocalMap>(map);
  }
  void TearDown() override { gst_harness_teardown(harness_); }

  // Pushes a picture that shows request_, in a set of `views`.
  GstFlowReturn push(const char* format = "I420", int views = 1) {
    gst_harness_set_src_caps(harness_, caps_of(format));
    GstBuffer* buffer = gst_buffer_new_allocate(nullptr, size_t{4} * kWidth * kHeight, nullptr);
    GST_BUFFER_PTS(buffer) = 5 * GST_SECOND;
    ViewMeta meta;
    for (int i = 0; i < views; i++) {
      ViewMetaEntry entry{.request = request_};
      entry.request.place.columns = std::max(views, 1);
      entry.request.place.index = i;
      entry.request.sequence = static_cast<uint32_t>(i);
      if (views > 0) meta.add(entry);
    }
    meta.attach(buffer);
    return gst_harness_push(harness_, buffer);
  }
  void expect_depths() {
    const BufferPtr out(gst_harness_pull(harness_));
    ASSERT_TRUE(out);
    EXPECT_EQ(GST_BUFFER_PTS(out.get()), 5 * GST_SECOND);
    EXPECT_TRUE(gst_buffer_get_custom_meta(out.get(), LF_VIEW_META)) << "for the pose";
    GstVideoInfo info;
    gst_video_info_set_format(&info, GST_VIDEO_FORMAT_GRAY16_LE, kWidth, kHeight);
    const std::vector<uint8_t> bytes = to_bytes(out.get());
    ASSERT_EQ(bytes.size(), GST_VIDEO_INFO_SIZE(&info));
    View shown = request_.view;
    if (request_.on_plane) shown.focus.map = nullptr;
    const DepthImage expected = depth_image(shown);
    for (int y = 0; y < kHeight; y++)
      for (int x = 0; x < kWidth; x++) {
        const size_t at = static_cast<size_t>(y) * GST_VIDEO_INFO_PLANE_STRIDE(&info, 0) + 2 * static_cast<size_t>(x);
        const int depth = bytes[at] + 256 * bytes[at + 1];
        const double metres = expected.depths[static_cast<size_t>(y) * kWidth + x];
        ASSERT_NEAR(depth, std::min(1000 * metres, 65535.), 0.51) << x << ", " << y;
      }
  }

  GstHarness* harness_ = nullptr;
  ViewRequest request_;
};

TEST_F(LfDepthTest, ReturnsTheDepthsOfTheSurface) {
  for (const char* format : {"I420", "RGB", "BGRx"}) {
    EXPECT_EQ(push(format), GST_FLOW_OK);
    expect_depths();
  }
}

TEST_F(LfDepthTest, ReturnsTheDepthsOfThePlane) {
  request_.on_plane = true;
  EXPECT_EQ(push(), GST_FLOW_OK);
  expect_depths();
}

TEST_F(LfDepthTest, PicturesWithoutTheMetaAreAnError) {
  const ElementBus bus(harness_->element);
  EXPECT_EQ(push("I420", 0), GST_FLOW_ERROR);
  EXPECT_THAT(bus.errors(), ElementsAre(mentions("lightfield-view", "lfviewsrc")));
}

TEST_F(LfDepthTest, SetsOfViewsAreAnError) {
  const ElementBus bus(harness_->element);
  EXPECT_EQ(push("I420", 2), GST_FLOW_ERROR);
  EXPECT_THAT(bus.errors(), ElementsAre(mentions("several views")));
}

TEST_F(LfDepthTest, ScaledPicturesAreAnError) {
  request_.view.width = 64;
  request_.view.height = 48;
  request_.view.focus.map = nullptr;
  const ElementBus bus(harness_->element);
  EXPECT_EQ(push(), GST_FLOW_ERROR);
  EXPECT_THAT(bus.errors(), ElementsAre(mentions("64x48", "61x35")));
}

}  // namespace
}  // namespace lf::test
