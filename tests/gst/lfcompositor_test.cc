// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gmock/gmock.h>
#include <gst/video/navigation.h>
#include <gtest/gtest.h>

#include "gst/compositor_fixture.h"
#include "node/pixel_access.h"
#include "wire/answer_parser.h"
#include "wire/command_codec.h"
#include "wire/fragment_codec.h"
#include "wire/payload.h"

namespace lf::test {
namespace {

using testing::HasSubstr;

TEST_F(LfCompositorTest, AddsOneNodesAnswer) {
  start(1);
  const ViewRequest asked = array_.request(0, 3 * kFrame);
  request(asked);
  push(0, answer_of(asked, {0, 1, 2, 3}));
  const std::vector<uint8_t> picture = pull();
  EXPECT_EQ(picture.size(), 16u * 12 * 3);
  EXPECT_EQ(last_pts_, 3 * kFrame);
  EXPECT_GE(range(picture).first, 199);
  EXPECT_LE(range(picture).second, 201);
  EXPECT_EQ(output_format(), "RGB");
}

TEST_F(LfCompositorTest, EveryStageIsTimed) {
  start(1);
  for (uint32_t i = 0; i < 5; i++) {
    const ViewRequest asked = array_.request(i, i * kFrame);
    request(asked);
    push(0, answer_of(asked, {0, 1, 2, 3}));
    pull();
  }
  for (const std::string stage : {"answer", "add", "picture", "composite", "latency"}) {
    const uint64_t p50 = stat(element_.get(), (stage + "-ns-p50").c_str());
    const uint64_t p95 = stat(element_.get(), (stage + "-ns-p95").c_str());
    const uint64_t p99 = stat(element_.get(), (stage + "-ns-p99").c_str());
    EXPECT_LE(p50, p95) << stage;
    EXPECT_LE(p95, p99) << stage;
    EXPECT_LE(p99, stat(element_.get(), "latency-ns-p99")) << stage;
  }
}

TEST_F(LfCompositorTest, TwoNodesAreOnePictureToTheBit) {
  const ViewRequest asked = array_.request(0, 0);
  start(1);
  Image noise(PixelFamily::kRgb, ArrayFixture::kWidth, ArrayFixture::kHeight);
  for (size_t i = 0; i < noise.data().size(); i++) noise.data()[i] = static_cast<uint8_t>(i * 2654435761u >> 24);
  const auto push_sums = [&](size_t node, const std::vector<CameraIndex>& cameras) {
    const ByteBuffer bytes = node_answer_bytes(array_.rig(), asked, cameras, noise, {{wire::Codec::kRaw16}});
    ASSERT_EQ(gst_harness_push(nodes_[node].get(), to_buffer({bytes.begin(), bytes.end()})), GST_FLOW_OK);
  };
  request(asked);
  push_sums(0, {0, 1, 2, 3});
  const std::vector<uint8_t> together = pull();
  nodes_.clear();
  start(2);
  request(asked);
  push_sums(1, {1, 3});
  push_sums(0, {0, 2});
  EXPECT_EQ(pull(), together);
  EXPECT_LT(range(together).first, range(together).second - 50) << "it shows something";
}

TEST_F(LfCompositorTest, AnswersComeBeforeTheRequestOrAfterIt) {
  start(1);
  const ViewRequest asked = array_.request(0, 0);
  push(0, answer_of(asked, {0, 1, 2, 3}));
  request(asked);
  EXPECT_GE(range(pull()).first, 199);
}

TEST_F(LfCompositorTest, ComposesBySequenceNotByArrival) {
  start(2);
  const ViewRequest first = array_.request(UINT32_MAX, 0), second = array_.request(0, kFrame);  // the number wraps
  request(first);
  push(0, answer_of(first, {0, 2}, 10));
  push(1, answer_of(second, {1, 3}, 250));  // this node skipped the first request
  const std::vector<uint8_t> dark = pull();
  EXPECT_LE(range(dark).second, 11);
  request(second);
  push(0, answer_of(second, {0, 2}, 250));
  EXPECT_GE(range(pull()).first, 248);
}

TEST_F(LfCompositorTest, OtherViewsAreIgnored) {
  start(1, {{"view-id", "2"}});
  const ViewRequest other = array_.request(0, 0, 1), own = array_.request(0, 0, 2);
  request(other);
  push(0, answer_of(other, {0, 1, 2, 3}, 10));
  request(own);
  push(0, answer_of(own, {0, 1, 2, 3}, 100));
  EXPECT_GE(range(pull()).first, 99);
  EXPECT_EQ(stat(element_.get(), "pictures"), 1u);
}

TEST_F(LfCompositorTest, DamagedFragmentsAreCountedAndTheRestIsComposed) {
  const ViewRequest asked = array_.request(0, 0);
  const wire::Answer answer = answer_of(asked, {0, 1, 2, 3});
  ByteBuffer bytes = wire::FragmentEncoder().encode(answer, answer.fragments, 90);
  const wire::AnswerView view = wire::parse_answer(bytes).value();
  const uint8_t marker[] = {0xff, 0xd9};
  for (const bool damage : {false, true}) {
    start(1, {{"rig", array_.rig_path()}});
    if (damage) std::ranges::copy(marker, bytes.begin() + (view.fragments[0].payload.data() - bytes.data()) + 4);
    request(asked);
    ASSERT_EQ(gst_harness_push(nodes_[0].get(), to_buffer({bytes.begin(), bytes.end()})), GST_FLOW_OK);
    const std::vector<uint8_t> picture = pull();
    if (!damage) {
      EXPECT_GE(range(picture).first, 190);
      EXPECT_LE(range(picture).second, 210);
    }
    EXPECT_EQ(stat(element_.get(), "damaged-fragments"), damage ? 1u : 0u);
    EXPECT_EQ(stat(element_.get(), "missing-fragments") > 0, damage);
    EXPECT_EQ(stat(element_.get(), "fragments"), answer.fragments.size() - damage);
    EXPECT_EQ(stat(element_.get(), "incomplete"), damage ? 1u : 0u);
    EXPECT_EQ(stat(element_.get(), "bad-answers"), 0u);
    nodes_.clear();
    harness_.reset();
  }
}

TEST_F(LfCompositorTest, LateAndForeignAnswersAreCounted) {
  start(1);
  const ViewRequest old = array_.request(4, 0), asked = array_.request(5, 0);
  wire::Answer other_rig = answer_of(asked, {0, 1, 2, 3});
  other_rig.rig_hash ^= 1;
  request(asked);
  push(0, answer_of(old, {0, 1, 2, 3}));
  ASSERT_EQ(gst_harness_push(nodes_[0].get(), to_buffer({9, 9, 9})), GST_FLOW_OK);
  push(0, other_rig);
  EXPECT_EQ(range(pull()).second, 0);  // nothing was composed
  EXPECT_EQ(stat(element_.get(), "late-answers"), 1u);
  EXPECT_EQ(stat(element_.get(), "bad-answers"), 1u);
  EXPECT_EQ(stat(element_.get(), "rig-mismatches"), 1u);
}

TEST_F(LfCompositorTest, WithTheRigTheOthersMakeUpForAMissingCamera) {
  start(1, {{"rig", array_.rig_path()}});
  const ViewRequest asked = array_.request(0, 0);
  request(asked);
  push(0, answer_of(asked, {0, 1, 2}));
  const std::vector<uint8_t> picture = pull();
  EXPECT_EQ(stat(element_.get(), "missing-fragments"), 1u);
  EXPECT_EQ(stat(element_.get(), "incomplete"), 1u);
  // Camera 3 is the far corner: towards the middle the other three have most of the weight and restore the grey.
  const size_t middle = (6 * 16 + 8) * 3;
  EXPECT_NEAR(picture[middle], 200, 6);
}

TEST_F(LfCompositorTest, PixelsOfCamerasAreRenderedHere) {
  const ViewRequest asked = array_.request(0, 0);
  const std::vector<CameraIndex> all{0, 1, 2, 3};
  Image image(PixelFamily::kRgb, ArrayFixture::kWidth, ArrayFixture::kHeight);
  std::ranges::fill(image.data(), uint8_t{200});
  std::vector<PixelSource> sources;
  for (const CameraIndex camera : all)
    sources.push_back(
        {{camera, &array_.rig().cameras[camera], image.view()}, {0, 0, ArrayFixture::kWidth, ArrayFixture::kHeight}});
  const ByteBuffer pixels = pixel_answer(answer_of(asked, all), sources, 0).bytes;
  const wire::AnyRequest command = pixel_access().command(array_.rig(), build_mesh(array_.rig()), asked);
  for (const bool with_rig : {true, false}) {
    nodes_.clear();
    with_rig ? start(1, {{"rig", array_.rig_path()}}) : start(1);
    request(asked);
    ASSERT_EQ(gst_harness_push(harness_.get(), to_buffer(wire::encode_any_request(command))),
              GST_FLOW_OK);  // for cameras
    ASSERT_EQ(gst_harness_push(nodes_[0].get(), to_buffer({pixels.begin(), pixels.end()})), GST_FLOW_OK);
    const std::vector<uint8_t> picture = pull();
    EXPECT_EQ(range(picture), with_rig ? std::pair(200, 200) : std::pair(0, 0));
    EXPECT_EQ(stat(element_.get(), "bad-answers"), with_rig ? 0u : 1u);
    EXPECT_EQ(stat(element_.get(), "bad-requests"), 0u);
    EXPECT_EQ(stat(element_.get(), "missing-fragments"), 0u);
  }
}

TEST_F(LfCompositorTest, BackgroundShowsWhereNothingContributes) {
  start(1, {{"rig", array_.rig_path()}, {"background", "0xff102030"}});
  const ViewRequest asked = array_.request(0, 0);
  request(asked);
  push(0, answer_of(asked, {}));
  const std::vector<uint8_t> picture = pull();
  EXPECT_EQ(picture[0], 0x10);
  EXPECT_EQ(picture[1], 0x20);
  EXPECT_EQ(picture[2], 0x30);
}

TEST_F(LfCompositorTest, I420StaysI420AndSizeMayChange) {
  start(1);
  ViewRequest asked = array_.request(0, 0);
  asked.view.width = 15;  // odd
  asked.view.height = 11;
  request(asked);
  push(0, answer_of(asked, {0, 1, 2, 3}, 90, PixelFamily::kI420));
  EXPECT_GE(pull()[0], 89);
  EXPECT_EQ(output_format(), "I420");
  ViewRequest larger = array_.request(1, kFrame);
  larger.view.width = 20;
  request(larger);
  push(0, answer_of(larger, {0, 1, 2, 3}));
  EXPECT_EQ(pull().size(), 20u * 12 * 3);
  EXPECT_EQ(output_format(), "RGB");
}

TEST_F(LfCompositorTest, DownstreamChoosesWithinTheFamily) {
  start(1, {}, "video/x-raw,format=BGRx");
  const ViewRequest asked = array_.request(0, 0);
  request(asked);
  push(0, answer_of(asked, {0, 1, 2, 3}));
  EXPECT_EQ(pull().size(), 16u * 12 * 4);
}

TEST_F(LfCompositorTest, EndOfRequestsEndsTheOutput) {
  start(1);
  const ViewRequest asked = array_.request(0, 0);
  request(asked);
  push(0, answer_of(asked, {0, 1, 2, 3}));
  pull();
  gst_harness_push_event(harness_.get(), gst_event_new_eos());  // the node does not end
  bool eos = false;
  for (int i = 0; i < 20 && !eos; i++) {
    GstEvent* event = gst_harness_pull_event(harness_.get());
    if (!event) break;
    eos = GST_EVENT_TYPE(event) == GST_EVENT_EOS;
    gst_event_unref(event);
  }
  EXPECT_TRUE(eos);
}

TEST_F(LfCompositorTest, NavigationGoesToTheRequestsAloneAndIsTagged) {
  start(1, {{"view-id", "6"}});
  gst_harness_push_upstream_event(
      harness_.get(), gst_event_new_navigation(gst_structure_new("application/x-gst-navigation", "event", G_TYPE_STRING,
                                                                 "mouse-move", "pointer_x", G_TYPE_DOUBLE, 1.0,
                                                                 "pointer_y", G_TYPE_DOUBLE, 2.0, nullptr)));
  GstEvent* event = nullptr;
  for (int i = 0; i < 10; i++) {
    event = gst_harness_try_pull_upstream_event(harness_.get());
    if (!event || GST_EVENT_TYPE(event) == GST_EVENT_NAVIGATION) break;
    gst_event_unref(event);
  }
  ASSERT_TRUE(event);
  guint view = 0;
  EXPECT_TRUE(gst_structure_get_uint(gst_event_get_structure(event), "lightfield-view-id", &view));
  EXPECT_EQ(view, 6u);
  gst_event_unref(event);
  while (GstEvent* other = gst_harness_try_pull_upstream_event(nodes_[0].get())) {
    EXPECT_NE(GST_EVENT_TYPE(other), GST_EVENT_NAVIGATION);
    gst_event_unref(other);
  }
}

TEST_F(LfCompositorTest, ErrorsNameThePlace) {
  start(1, {}, "video/x-raw,format=I420");
  const ViewRequest asked = array_.request(0, 0);
  GstBus* bus = gst_bus_new();
  gst_element_set_bus(element_.get(), bus);
  request(asked);
  push(0, answer_of(asked, {0, 1, 2, 3}));
  GstMessage* message = gst_bus_timed_pop_filtered(bus, 5 * GST_SECOND, GST_MESSAGE_ERROR);
  ASSERT_TRUE(message);
  GError* error = nullptr;
  gst_message_parse_error(message, &error, nullptr);
  EXPECT_THAT(error->message, HasSubstr("a videoconvert in between"));
  g_clear_error(&error);
  gst_message_unref(message);
  gst_element_set_bus(element_.get(), nullptr);
  gst_object_unref(bus);

  const ElementPtr pipeline = launch("lfcompositor rig=/nowhere/rig.json ! fakesink");
  EXPECT_THAT(run(pipeline.get(), 5), HasSubstr("/nowhere/rig.json"));
}

}  // namespace
}  // namespace lf::test
