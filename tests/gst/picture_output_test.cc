// SPDX-License-Identifier: LGPL-2.1-or-later
#include "compositor/picture_output.h"

#include <semaphore>

#include "common/common.h"
#include "gst/compositor_fixture.h"
#include "scene/scene.h"
#include "view/navigator.h"

namespace lf::test {
namespace {

using OutputAction = PictureOutput::OutputAction;

class PictureOutputTest : public testing::Test {
 protected:
  PictureOutputTest() {
    hooks_.aggregate = [this] {
      turn_();
      done_.release();
    };
    hooks_.negotiate = [this] { output_->negotiate(follows_); };
    hooks_.update_caps = [this](GstCaps* downstream, GstCaps** caps) {
      return output_->update_src_caps(downstream, caps);
    };
    hooks_.negotiated = [this](GstCaps* caps) { return output_->negotiated_src_caps(caps); };
    hooks_.allocation = [this](GstQuery* query) { return output_->decide_allocation(query); };
    element_ = GST_ELEMENT(gst_object_ref_sink(new_test_aggregator(&hooks_)));
    output_.emplace(GST_AGGREGATOR(element_));
    request_pad_ = gst_pad_new("request", GST_PAD_SINK);
    request_.view = make_view(default_viewpoint(rig_), 32, 16);
    assembly_.set_rig(std::make_shared<const Rig>(rig_));
  }
  ~PictureOutputTest() override {
    output_->stop();
    harness_.reset();
    output_.reset();
    gst_object_unref(element_);
    gst_object_unref(request_pad_);
  }
  void begin(bool partial, const char* sink_caps) {
    output_->start(partial, request_pad_);
    harness_.reset(gst_harness_new_with_element(element_, "sink_%u", "src"));
    gst_harness_set_sink_caps_str(harness_.get(), sink_caps);
    gst_harness_set_src_caps_str(harness_.get(), "requests");
    GstSegment segment;
    gst_segment_init(&segment, GST_FORMAT_TIME);
    in_stream([&] { output_->follow_segment(segment); });
  }
  // GstAggregator's thread holds its lock while waiting: negotiating or pushing from another thread would deadlock.
  void in_stream(std::function<void()> turn) {
    turn_ = std::move(turn);
    ASSERT_EQ(gst_harness_push(harness_.get(), gst_buffer_new()), GST_FLOW_OK);
    done_.acquire();
  }
  void answer(const std::vector<CameraIndex>& cameras, uint8_t grey) {
    assembly_.begin(request_);
    if (cameras.empty()) return;
    const int width = rig_.cameras[0].width, height = rig_.cameras[0].height;
    Image image(family_, width, height);
    std::ranges::fill(image.data(), family_ == PixelFamily::kRgb ? grey : uint8_t{128});
    std::fill_n(image.data().begin(), width * height, grey);
    const ByteBuffer bytes = node_answer_bytes(rig_, request_, cameras, image);
    ASSERT_EQ(assembly_.add(*wire::parse_answer(bytes)), Assembly::Verdict::kAdded);
  }
  // Returns the picture of the added answers; null if there is none (`flow_` has the reason).
  GstBuffer* make() {
    GstBuffer* picture = nullptr;
    bool dropped = false;
    in_stream([&] { picture = output_->make_picture(assembly_, request_, {}, &flow_, &dropped); });
    dropped_ += dropped;
    return picture;
  }
  // Returns the error if downstream accepts only these caps, or "".
  std::string refusal(const char* sink_caps) {
    begin(false, sink_caps);
    const ElementBus bus(element_);
    answer({0, 1, 2, 3}, 100);
    const BufferPtr picture(make());
    EXPECT_EQ(flow_ == GST_FLOW_NOT_NEGOTIATED, output_->has_refused());
    const std::vector<std::string> errors = bus.errors();
    return errors.empty() ? "" : errors[0];
  }
  // Returns the uniform picture that view `index` completes; null while views of the set are missing.
  GstBuffer* add_view(const ViewSet& set, int index, uint32_t first, uint8_t grey) {
    request_.place = set.place(index);
    request_.sequence = first + static_cast<uint32_t>(request_.place.turn());
    answer({0, 1, 2, 3}, grey);
    GstBuffer* picture = make();
    EXPECT_EQ(flow_, GST_FLOW_OK);
    return picture;
  }
  GstFlowReturn push(GstBuffer* picture, GstClockTime pts = 0) {
    GST_BUFFER_PTS(picture) = pts;
    GstFlowReturn flow = GST_FLOW_ERROR;
    in_stream([&] { flow = output_->push(picture, pts, true); });
    return flow;
  }
  static int middle(GstBuffer* picture, const ViewSetPosition& place = {}) {
    const int x = place.column() * 32 + 16, y = place.row() * 16 + 8;
    return to_bytes(picture)[3 * static_cast<size_t>(y * place.columns * 32 + x)];
  }

  std::function<void()> turn_ = [] {};
  std::binary_semaphore done_{0};
  Hooks hooks_;
  GstElement* element_ = nullptr;
  GstPad* request_pad_ = nullptr;
  std::optional<PictureOutput> output_;
  HarnessPtr harness_;
  const Rig rig_ = scene_rig(2, 2, 32, 24);
  ViewRequest request_;
  Assembly assembly_;
  GstFlowReturn flow_ = GST_FLOW_OK;
  int dropped_ = 0;
  bool follows_ = false;  // the view's next requests have an accepted size
  PixelFamily family_ = PixelFamily::kRgb;
};

TEST_F(PictureOutputTest, PicturesHaveCapsThatDownstreamAccepts) {
  begin(false, "video/x-raw, format=BGR");
  EXPECT_FALSE(output_->has_begun());
  answer({0, 1, 2, 3}, 100);
  GstBuffer* picture = make();
  ASSERT_TRUE(picture);
  EXPECT_TRUE(output_->has_begun());
  EXPECT_EQ(push(picture, GST_SECOND), GST_FLOW_OK);
  const BufferPtr out(gst_harness_pull(harness_.get()));
  ASSERT_TRUE(out);
  EXPECT_EQ(GST_BUFFER_PTS(out.get()), GST_SECOND);
  EXPECT_EQ(middle(out.get()), 100);
  EXPECT_THAT(caps_of(harness_->sinkpad), HasSubstr("format=(string)BGR, width=(int)32, height=(int)16"));
}

TEST_F(PictureOutputTest, SizeChangesAreRenegotiated) {
  begin(false, "video/x-raw, format=RGB");
  answer({0, 1, 2, 3}, 100);
  ASSERT_EQ(push(make()), GST_FLOW_OK);
  request_.view = make_view(default_viewpoint(rig_), 48, 16);
  answer({0, 1, 2, 3}, 100);
  ASSERT_EQ(push(make(), GST_SECOND), GST_FLOW_OK);
  const BufferPtr small(gst_harness_pull(harness_.get())), wide(gst_harness_pull(harness_.get()));
  EXPECT_EQ(gst_buffer_get_size(small.get()), 32u * 16 * 3);
  EXPECT_EQ(gst_buffer_get_size(wide.get()), 48u * 16 * 3);
}

TEST_F(PictureOutputTest, ErrorNamesTheRefusedFormat) {
  EXPECT_THAT(refusal("video/x-raw, format=NV12; video/x-raw, format=YUY2, width=64"),
              mentions("RGB", "format=NV12", "format=YUY2", "videoconvert"));
  EXPECT_EQ(flow_, GST_FLOW_NOT_NEGOTIATED);
}

TEST_F(PictureOutputTest, ErrorNamesTheRefusedSize) {
  EXPECT_THAT(refusal("video/x-raw, format=NV12; video/x-raw, format=RGB, width=64, height=48"),
              mentions("32x16", "width=64,height=48", "leave"));
  EXPECT_EQ(flow_, GST_FLOW_NOT_NEGOTIATED);
}

TEST_F(PictureOutputTest, ErrorNamesTheRefusedRate) {
  EXPECT_THAT(refusal("video/x-raw, framerate=30/1"), mentions("0/1", "framerate=30/1", "leave"));
  EXPECT_EQ(flow_, GST_FLOW_NOT_NEGOTIATED);
}

// The old pictures were requested before the size changed.
TEST_F(PictureOutputTest, PicturesOfTheOldSizeAreDropped) {
  follows_ = true;
  EXPECT_EQ(refusal("video/x-raw, width=64, height=48"), "");
  EXPECT_EQ(flow_, GST_FLOW_OK);
  EXPECT_EQ(dropped_, 1);
  request_.view = make_view(default_viewpoint(rig_), 64, 48);
  answer({0, 1, 2, 3}, 100);
  GstBuffer* picture = make();
  ASSERT_TRUE(picture);
  EXPECT_EQ(push(picture, GST_SECOND), GST_FLOW_OK);
}

TEST_F(PictureOutputTest, SizeChangesKeepTheFormat) {
  follows_ = true;
  EXPECT_THAT(refusal("video/x-raw, format=NV12"), HasSubstr("videoconvert"));
}

TEST_F(PictureOutputTest, PreviousPictureReplacesAnIncompleteOne) {
  begin(false, "video/x-raw, format=RGB");
  answer({0, 1, 2, 3}, 100);
  GstBuffer* whole = make();
  EXPECT_EQ(output_->replace_incomplete(assembly_, LF_COMPOSITOR_INCOMPLETE_REPEAT, &whole), OutputAction::kPicture);
  ASSERT_EQ(push(whole), GST_FLOW_OK);

  answer({0}, 200);
  GstBuffer* part = make();
  ASSERT_FALSE(assembly_.complete());
  EXPECT_EQ(output_->replace_incomplete(assembly_, LF_COMPOSITOR_INCOMPLETE_CONCEAL, &part), OutputAction::kPicture);
  EXPECT_EQ(output_->replace_incomplete(assembly_, LF_COMPOSITOR_INCOMPLETE_REPEAT, &part), OutputAction::kRepeated);
  EXPECT_EQ(middle(part), 100);
  EXPECT_EQ(output_->replace_incomplete(assembly_, LF_COMPOSITOR_INCOMPLETE_DROP, &part), OutputAction::kDropped);
  EXPECT_FALSE(part);
}

TEST_F(PictureOutputTest, PreviousPictureIsShownWithoutAnswers) {
  begin(false, "video/x-raw, format=RGB");
  answer({}, 0);
  const BufferPtr dark(make());
  EXPECT_EQ(middle(dark.get()), 0) << "no earlier picture";
  answer({0, 1, 2, 3}, 100);
  ASSERT_EQ(push(make()), GST_FLOW_OK);
  answer({}, 0);
  const BufferPtr again(make());
  EXPECT_EQ(middle(again.get()), 100);
}

// The first view of a quilt is at the bottom left.
class PictureOutputQuilt : public PictureOutputTest {
 protected:
  void check(const std::string& format, PixelFamily family) {
    begin(false, ("video/x-raw, format=" + format).c_str());
    family_ = family;
    const ViewSet set{.layout = ViewSetLayout::kQuilt, .columns = 3, .rows = 2};
    GstBuffer* picture = nullptr;
    for (const ViewSetPosition& place : set.places()) {
      EXPECT_FALSE(picture);
      picture = add_view(set, place.index, 10, static_cast<uint8_t>(40 * (place.index + 1)));
    }
    ASSERT_TRUE(picture) << format;
    ASSERT_EQ(push(picture), GST_FLOW_OK);
    const BufferPtr out(gst_harness_pull(harness_.get()));
    const CapsPtr caps(gst_pad_get_current_caps(harness_->sinkpad));
    GstVideoInfo info;
    ASSERT_TRUE(gst_video_info_from_caps(&info, caps.get()));
    EXPECT_EQ(info.width, 96);
    EXPECT_EQ(info.height, 32);
    EXPECT_EQ(GST_VIDEO_INFO_MULTIVIEW_MODE(&info), GST_VIDEO_MULTIVIEW_MODE_NONE);
    GstVideoFrame frame;
    ASSERT_TRUE(gst_video_frame_map(&frame, &info, out.get(), GST_MAP_READ));
    // Samples the centres, because the array does not cover the whole view.
    for (int y = 8; y < 32; y += 16)
      for (int x = 16; x < 96; x += 32) {
        const int index = (1 - y / 16) * 3 + x / 32;
        const auto* row = static_cast<const guint8*>(GST_VIDEO_FRAME_COMP_DATA(&frame, 0)) +
                          y * GST_VIDEO_FRAME_COMP_STRIDE(&frame, 0);
        EXPECT_EQ(row[x * GST_VIDEO_FRAME_COMP_PSTRIDE(&frame, 0)], 40 * (index + 1)) << format << " " << x << " " << y;
      }
    gst_video_frame_unmap(&frame);
    EXPECT_EQ(dropped_, 0);
  }
};

TEST_F(PictureOutputQuilt, Rgb) { check("RGB", PixelFamily::kRgb); }
TEST_F(PictureOutputQuilt, YCbCr) { check("I420", PixelFamily::kI420); }
TEST_F(PictureOutputQuilt, Nv12) { check("NV12", PixelFamily::kI420); }

TEST_F(PictureOutputTest, StereoPairsHaveAMultiviewMode) {
  const std::pair<ViewSetLayout, const char*> layouts[] = {
      {ViewSetLayout::kStereo, "multiview-mode=(string)side-by-side"},
      {ViewSetLayout::kTopBottom, "multiview-mode=(string)top-bottom"},
      {ViewSetLayout::kCrossEyed, "right-view-first"}};
  begin(false, "video/x-raw, format=RGB");
  uint32_t first = 10;
  for (const auto& [layout, words] : layouts) {
    const ViewSet set{.layout = layout};
    EXPECT_FALSE(add_view(set, 0, first, 100));
    EXPECT_TRUE(output_->is_drawing(request_));
    GstBuffer* picture = add_view(set, 1, first, 200);
    ASSERT_TRUE(picture);
    EXPECT_EQ(middle(picture, set.place(0)), 100);
    EXPECT_EQ(middle(picture, set.place(1)), 200);
    ASSERT_EQ(push(picture, first * GST_SECOND), GST_FLOW_OK);
    gst_buffer_unref(gst_harness_pull(harness_.get()));
    EXPECT_THAT(caps_of(harness_->sinkpad), HasSubstr(words));
    first += 2;
  }
}

TEST_F(PictureOutputTest, IncompleteSetIsDropped) {
  begin(false, "video/x-raw, format=RGB");
  const ViewSet set{.layout = ViewSetLayout::kStereo};
  EXPECT_FALSE(add_view(set, 0, 10, 100));
  EXPECT_FALSE(add_view(set, 1, 12, 150)) << "next capture time";
  EXPECT_EQ(dropped_, 1);
  const BufferPtr picture(add_view(set, 0, 12, 50));
  ASSERT_TRUE(picture);
  EXPECT_EQ(middle(picture.get(), set.place(0)), 50);
  EXPECT_EQ(middle(picture.get(), set.place(1)), 150);
  EXPECT_EQ(dropped_, 1);
}

TEST_F(PictureOutputTest, LostPartsShowThePreviousPicture) {
  begin(false, "video/x-raw, format=RGB");
  const ViewSet set{.layout = ViewSetLayout::kStereo};
  add_view(set, 0, 10, 100);
  GstBuffer* whole = add_view(set, 1, 10, 200);
  EXPECT_EQ(output_->replace_incomplete(assembly_, LF_COMPOSITOR_INCOMPLETE_REPEAT, &whole), OutputAction::kPicture);
  ASSERT_EQ(push(whole), GST_FLOW_OK);
  request_.place = set.place(0);
  request_.sequence = 12;
  answer({}, 0);
  EXPECT_FALSE(make());
  GstBuffer* mended = add_view(set, 1, 12, 220);
  ASSERT_TRUE(mended);
  EXPECT_EQ(middle(mended, set.place(0)), 100);
  EXPECT_EQ(middle(mended, set.place(1)), 220);
  EXPECT_EQ(output_->replace_incomplete(assembly_, LF_COMPOSITOR_INCOMPLETE_DROP, &mended), OutputAction::kDropped)
      << "one of its views was incomplete";
}

TEST_F(PictureOutputTest, PartialAnswersListTheReceivedCameras) {
  begin(true, LF_ANSWER_CAPS);
  answer({0, 3}, 100);
  GstBuffer* made = nullptr;
  in_stream([&] { made = output_->make_answer(assembly_, request_, 7, CodecChoice::kAuto, &flow_); });
  ASSERT_TRUE(made) << flow_;
  ASSERT_EQ(push(made), GST_FLOW_OK);
  const BufferPtr out(gst_harness_pull(harness_.get()));
  const std::vector<uint8_t> bytes = to_bytes(out.get());
  const auto parsed = wire::parse_answer(bytes);
  ASSERT_TRUE(parsed);
  EXPECT_EQ(parsed->node, 7u);
  EXPECT_EQ(parsed->cameras, CameraRanges(CameraSet{0, 3}));
}

}  // namespace
}  // namespace lf::test
