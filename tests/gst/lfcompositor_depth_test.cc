// SPDX-License-Identifier: LGPL-2.1-or-later
//
// The request pads depth_src and confidence_src of lfcompositor.
#include "compositor/depth_output.h"
#include "compositor/view_meta.h"
#include "gst/compositor_fixture.h"
#include "view/depth_image.h"

namespace lf::test {
namespace {

double field(const GstStructure* structure, const char* name) {
  double value = NAN;
  EXPECT_TRUE(gst_structure_get_double(structure, name, &value)) << name;
  return value;
}

const GstStructure* meta_of(GstBuffer* buffer) {
  GstCustomMeta* meta = gst_buffer_get_custom_meta(buffer, LF_VIEW_META);
  return meta ? gst_custom_meta_get_structure(meta) : nullptr;
}

// Compares the depth values of a view with their definition. The first pixel of the view is at (left, top).
void expect_depths(GstBuffer* buffer, int width, const View& shown, double scale, double offset, int left = 0,
                   int top = 0) {
  const std::vector<uint8_t> bytes = to_bytes(buffer);
  const size_t stride = (2 * static_cast<size_t>(width) + 3) / 4 * 4;
  const DepthImage expected = depth_image(shown);
  for (int y = 0; y < shown.height; y++)
    for (int x = 0; x < shown.width; x++) {
      const size_t at = static_cast<size_t>(top + y) * stride + 2 * static_cast<size_t>(left + x);
      const int value = bytes[at] + 256 * bytes[at + 1];
      const double depth = expected.depths[static_cast<size_t>(y) * shown.width + x];
      const double expected_value = depth > 0 ? std::clamp((1 / depth - offset) / scale, 1., 65535.) : 0;
      ASSERT_NEAR(value, expected_value, 0.501) << x << ", " << y;
    }
}

FocalMap uneven_surface(const View& view) {
  FocalMap map = *flat_surface(view);
  for (size_t i = 0; i < map.levels.size(); i++) map.levels[i] = static_cast<uint8_t>(31 * i);
  return map;
}

class LfCompositorDepthTest : public LfCompositorTest {
 protected:
  void start_with_depths(const std::vector<std::pair<std::string, std::string>>& properties = {}) {
    start(1, properties);
    depths_.reset(gst_harness_new_with_element(element_.get(), nullptr, LF_DEPTH_PAD));
    confidences_.reset(gst_harness_new_with_element(element_.get(), nullptr, LF_CONFIDENCE_PAD));
  }
  void TearDown() override {
    depths_.reset();
    confidences_.reset();
  }

  HarnessPtr depths_, confidences_;
};

TEST_F(LfCompositorDepthTest, DepthsAreThoseOfThePicture) {
  using Properties = std::vector<std::pair<std::string, std::string>>;
  struct Case {
    const char* what;
    Properties properties;
    double farthest, nearest;  // 1/m; nearest is 0 if unknown
  };
  const std::pair<std::string, std::string> rig{"rig", array_.rig_path()};
  for (const auto& [what, properties, farthest, nearest] :
       {Case{"no rig", {}, 0, 0}, Case{"no limits", {rig}, 0, 0},
        Case{"both limits", {rig, {"focus-near", "4"}, {"focus-far", "16"}}, 1 / 16., 1 / 4.},
        Case{"equal limits are ignored", {rig, {"focus-near", "4"}, {"focus-far", "4"}}, 0, 0},
        Case{"nearer than the array can measure", {{"focus-far", "0.0625"}}, 16, 64 - 2 * 48. / 65536}}) {
    SCOPED_TRACE(what);
    start_with_depths(properties);
    for (uint32_t i = 0; i < 4; i++) {
      ViewRequest asked = array_.request(i, (5 + i) * kFrame);
      asked.view.pose.position.z = i == 1 ? 0.3 : 0;
      asked.view.focus.map = std::make_shared<FocalMap>(uneven_surface(asked.view));
      asked.on_plane = i == 2;
      request_and_answer(asked, {0, 1, 2, 3}, 200, i == 3 ? PixelFamily::kI420 : PixelFamily::kRgb);
      const BufferPtr picture(gst_harness_pull(harness_.get())), depths(gst_harness_pull(depths_.get()));
      const BufferPtr confidences(gst_harness_pull(confidences_.get()));
      ASSERT_TRUE(picture && depths && confidences);
      EXPECT_EQ(GST_BUFFER_PTS(depths.get()), GST_BUFFER_PTS(picture.get()));
      EXPECT_EQ(GST_BUFFER_DURATION(depths.get()), kFrame);
      ASSERT_TRUE(meta_of(depths.get()));
      EXPECT_EQ(views_of_picture(meta_of(depths.get())).at(0).view.pose, asked.view.pose);
      const double scale = field(meta_of(depths.get()), "depth-scale");
      const double offset = field(meta_of(depths.get()), "depth-offset");
      EXPECT_NEAR(offset + scale, farthest, 1e-9) << "focus-far";
      if (nearest > 0) {
        EXPECT_NEAR(offset + 65535 * scale, nearest, 1e-9) << "focus-near";
      } else {
        EXPECT_EQ(std::exp2(std::round(std::log2(scale))), scale) << "a power of two";
        EXPECT_EQ(offset, -scale);
      }
      const CapsPtr caps(gst_pad_get_current_caps(depths_->sinkpad));
      const GstStructure* structure = gst_caps_get_structure(caps.get(), 0);
      EXPECT_STREQ(gst_structure_get_string(structure, "format"), "GRAY16_LE");
      EXPECT_EQ(field(structure, "depth-scale"), scale);
      EXPECT_EQ(field(structure, "depth-offset"), offset);
      EXPECT_FALSE(gst_structure_has_field(structure, "colorimetry"));
      View shown = asked.view;
      if (asked.on_plane) shown.focus.map = nullptr;
      expect_depths(depths.get(), shown.width, shown, scale, offset);
      EXPECT_EQ(range(to_bytes(confidences.get())), (std::pair{0, 0})) << "nothing was tested";
    }
    TearDown();
  }
}

// The end, flushes and the segment reach the pads, with and without a link of the source pad.
TEST_F(LfCompositorDepthTest, EventsOfTheStreamReachThePads) {
  for (const bool is_linked : {true, false}) {
    start_with_depths();
    const ElementBus bus(element_.get());
    const PadPtr src = pad_of(element_.get(), "src");
    if (!is_linked) gst_pad_unlink(src.get(), harness_->sinkpad);
    uint32_t sequence = 0;
    const auto expect_depth = [&] {
      ask_and_answer(sequence, sequence * kFrame, {0, 1, 2, 3});
      const BufferPtr depths(gst_harness_pull(depths_.get())), confidences(gst_harness_pull(confidences_.get()));
      ASSERT_TRUE(depths && confidences);
      EXPECT_EQ(GST_BUFFER_PTS(depths.get()), sequence++ * kFrame);
    };
    for (int i = 0; i < 3; i++) expect_depth();
    flush(harness_.get());
    flush(nodes_[0].get());
    for (int i = 0; i < 3; i++) expect_depth();
    const EventPtr segment(gst_pad_get_sticky_event(depths_->sinkpad, GST_EVENT_SEGMENT, 0));
    const EventPtr expected(gst_pad_get_sticky_event(src.get(), GST_EVENT_SEGMENT, 0));
    EXPECT_EQ(segment, expected);
    gst_harness_push_event(harness_.get(), gst_event_new_eos());
    EXPECT_TRUE(reaches_eos(depths_.get()));
    EXPECT_TRUE(reaches_eos(confidences_.get()));
    EXPECT_EQ(bus.warnings(), "");
    TearDown();
  }
}

TEST_F(LfCompositorDepthTest, PadsComeAndGoWhileRunning) {
  start(1);
  ask_and_answer(0, 0, {0});
  pull();
  for (uint32_t i = 1; i < 4; i++) {
    depths_.reset(gst_harness_new_with_element(element_.get(), nullptr, LF_DEPTH_PAD));
    ask_and_answer(i, i * kFrame, {0});
    pull();
    EXPECT_TRUE(BufferPtr(gst_harness_pull(depths_.get())));
    depths_.reset();  // releases the pad
    EXPECT_FALSE(pad_of(element_.get(), LF_DEPTH_PAD));
  }
}

TEST_F(LfCompositorDepthTest, QueriesAndEventsReachTheRequests) {
  start_with_depths();
  ask_and_answer(0, 3 * kFrame, {0});
  pull();
  gint64 position = 0;
  EXPECT_TRUE(gst_pad_peer_query_position(depths_->sinkpad, GST_FORMAT_TIME, &position));
  EXPECT_EQ(position, static_cast<gint64>(3 * kFrame));
  GstStructure* key = gst_structure_new("application/x-gst-navigation", "event", G_TYPE_STRING, "key-press", nullptr);
  EXPECT_TRUE(gst_harness_push_upstream_event(depths_.get(), gst_event_new_navigation(key)));
  bool is_there = false;
  for (EventPtr event; (event.reset(gst_harness_try_pull_upstream_event(harness_.get())), event);)
    is_there |= GST_EVENT_TYPE(event.get()) == GST_EVENT_NAVIGATION;
  EXPECT_TRUE(is_there);
  EXPECT_TRUE(gst_harness_push_upstream_event(
      depths_.get(), gst_event_new_qos(GST_QOS_TYPE_UNDERFLOW, 0.1, 10 * GST_SECOND, 100 * GST_SECOND)));
  ask_and_answer(1, 4 * kFrame, {0});
  pull();
  EXPECT_EQ(stat(element_.get(), "skipped"), 0u) << "late depths skip no pictures";
}

// Each view of a set is at its place. Only the middle view has confidences, which are interpolated between the nodes.
TEST_F(LfCompositorDepthTest, SetsOfViewsHaveDepths) {
  register_view_meta();
  const ElementPtr element = make_element("lfcompositor");
  DepthOutput output(element.get());
  for (const char* name : {LF_DEPTH_PAD, LF_CONFIDENCE_PAD}) {
    GstElementClass* klass = GST_ELEMENT_GET_CLASS(element.get());
    ASSERT_TRUE(output.add_pad(gst_element_class_get_pad_template(klass, name)));
  }
  EXPECT_TRUE(output.make(BufferPtr(gst_buffer_new()).get()).empty()) << "no meta";
  ViewMeta meta;
  std::vector<ViewRequest> views;
  for (int turn = 0; turn < 6; turn++) {
    ViewMetaEntry entry{.request = array_.request(0, 0)};
    ViewSetPosition& place = entry.request.place;
    place = {.layout = ViewSetLayout::kQuilt, .columns = 3, .rows = 2, .index = 0};
    for (place.index = 0; place.turn() != turn;) place.index++;
    entry.request.sequence = static_cast<uint32_t>(turn);
    entry.request.view.pose.position.x = 0.1 * place.index;
    FocalMap map = uneven_surface(entry.request.view);
    map.nearest *= 1 + place.index;
    entry.request.view.focus.map = std::make_shared<FocalMap>(map);
    if (place.leads()) {
      map.farthest = 0;
      map.nearest = 1;
      entry.confidence = std::make_shared<FocalMap>(map);
    }
    views.push_back(entry.request);
    meta.add(std::move(entry));
  }
  const BufferPtr picture(gst_buffer_new());
  meta.attach(picture.get());
  const ElementPtr sinks[] = {make_element("fakesink"), make_element("fakesink")};
  for (const size_t i : {0, 1}) {
    const PadPtr src = pad_of(element.get(), i == 0 ? LF_DEPTH_PAD : LF_CONFIDENCE_PAD);
    ASSERT_EQ(gst_pad_link_full(src.get(), pad_of(sinks[i].get(), "sink").get(), GST_PAD_LINK_CHECK_NOTHING),
              GST_PAD_LINK_OK);
  }
  const std::vector<DepthOutput::Output> outputs = output.make(picture.get());
  ASSERT_EQ(outputs.size(), 2u);
  const double scale = field(meta_of(outputs[0].buffer.get()), "depth-scale");
  const std::vector<uint8_t> confidences = to_bytes(outputs[1].buffer.get());
  const int width = views[0].view.width, height = views[0].view.height;
  ASSERT_EQ(confidences.size(), static_cast<size_t>(6 * width * height));
  for (const ViewRequest& shown : views) {
    const int left = shown.place.column() * width, top = shown.place.row() * height;
    expect_depths(outputs[0].buffer.get(), 3 * width, shown.view, scale, -scale, left, top);
    FocalMap map = *shown.view.focus.map;
    map.farthest = 0;
    map.nearest = 1;
    for (int y = 0; y < height; y++)
      for (int x = 0; x < width; x++)
        ASSERT_NEAR(confidences[static_cast<size_t>(top + y) * 3 * width + left + x],
                    shown.place.leads() ? 255 * map.inverse_at(x, y) : 0, 0.51)
            << shown.place.index << ": " << x << ", " << y;
  }
  for (const char* name : {LF_DEPTH_PAD, LF_CONFIDENCE_PAD})
    EXPECT_TRUE(output.remove_pad(pad_of(element.get(), name).get()));
}

}  // namespace
}  // namespace lf::test
