// SPDX-License-Identifier: LGPL-2.1-or-later
//
// What a message asks for is bounded before anything is done for it: requests beyond a limit are dropped, counted and
// told of.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "gst/fragment_fixture.h"
#include "gst/rtp_fixture.h"
#include "rtp/payload_format.h"

namespace lf::test {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

class FragmentLimitsTest : public LfFragmentTest {
 protected:
  void SetUp() override {
    start(4);
    push_frames(100, 0);
    for (const HarnessPtr& camera : cameras_) gst_harness_push_event(camera.get(), gst_event_new_eos());
    listen();
  }
  ViewRequest asked(uint32_t view_id) { return array_.request(sequence_++, 0, view_id); }
  bool is_answered(const ViewRequest& asked) {
    EXPECT_EQ(request(asked), GST_FLOW_OK);
    return BufferPtr(gst_harness_try_pull(harness_.get())) != nullptr;
  }
  uint32_t sequence_ = 0;
};

TEST_F(FragmentLimitsTest, WhatAsksForTooMuchIsRefusedAndCounted) {
  EXPECT_TRUE(is_answered(asked(1)));
  ViewRequest large = asked(2);
  large.view.width = large.view.height = kMaxImageSize;
  EXPECT_FALSE(is_answered(large));
  ViewRequest wide = asked(3);
  wide.view.blending = {Blending::Kind::kAperture, 1e6, 0};
  EXPECT_FALSE(is_answered(wide));
  wide.view.blending.aperture = 0.05;
  EXPECT_TRUE(is_answered(wide));
  set("max-aperture", "0.01");
  EXPECT_FALSE(is_answered(wide));
  set("max-pixels", "100");
  EXPECT_FALSE(is_answered(asked(1)));
  set("max-pixels", "1000000");
  EXPECT_TRUE(is_answered(asked(1)));
  EXPECT_EQ(stat(element_.get(), "refused-pixels"), 2u);
  EXPECT_EQ(stat(element_.get(), "refused-aperture"), 2u);
  EXPECT_EQ(stat(element_.get(), "refused"), 4u);
  EXPECT_EQ(stat(element_.get(), "bad-requests"), 0u);
  // Once a second.
  const std::vector<std::string> told = warnings();
  ASSERT_GE(told.size(), 1u);
  EXPECT_THAT(told[0], HasSubstr("View 2 asks for 16384x16384 pixels"));
  EXPECT_THAT(told[0], HasSubstr("max-pixels"));
  EXPECT_LT(told.size(), 4u);
}

TEST_F(FragmentLimitsTest, MoreTrialsThanAllowedAreRefused) {
  ViewRequest curious = asked(1);
  FocalMap map = FocalMap::for_view(curious.view.width, curious.view.height);
  map.from = {{0, 0, 1}, 0};
  map.farthest = 0.05;
  map.nearest = 0.3;
  map.levels.assign(static_cast<size_t>(map.columns) * map.rows, 51);
  curious.view.focus.map = std::make_shared<FocalMap>(std::move(map));
  curious.trials = {{Trial::Kind::kBlurred, 0}, {Trial::Kind::kPlane, 200}};
  set("max-trials", "1");
  EXPECT_FALSE(is_answered(curious));
  EXPECT_EQ(stat(element_.get(), "refused-trials"), 1u);
  set("max-trials", "2");
  curious.sequence = sequence_++;
  EXPECT_TRUE(is_answered(curious));
}

// "lightfield-answer" has what an answer is and what it took.
TEST_F(FragmentLimitsTest, AnswersArePostedWhereThatIsAskedFor) {
  g_autoptr(GstBus) bus = gst_bus_new();
  gst_element_set_bus(element_.get(), bus);
  EXPECT_TRUE(is_answered(asked(3)));
  EXPECT_EQ(gst_bus_pop_filtered(bus, GST_MESSAGE_ELEMENT), nullptr);
  set("post-messages", "true");
  const ViewRequest second = asked(4);
  EXPECT_TRUE(is_answered(second));
  g_autoptr(GstMessage) message = gst_bus_pop_filtered(bus, GST_MESSAGE_ELEMENT);
  ASSERT_TRUE(message);
  const GstStructure* answer = gst_message_get_structure(message);
  EXPECT_STREQ(gst_structure_get_name(answer), "lightfield-answer");
  guint view = 0, sequence = 0, fragments = 0;
  guint64 bytes = 0;
  EXPECT_TRUE(gst_structure_get(answer, "view-id", G_TYPE_UINT, &view, "sequence", G_TYPE_UINT, &sequence, "fragments",
                                G_TYPE_UINT, &fragments, "bytes", G_TYPE_UINT64, &bytes, nullptr));
  EXPECT_EQ(view, 4u);
  EXPECT_EQ(sequence, second.sequence);
  EXPECT_GT(fragments, 0u);
  EXPECT_GT(bytes, 0u);
  gst_element_set_bus(element_.get(), nullptr);
}

// Smaller strips lose less with a lost packet; 16 rows are the least.
TEST_F(FragmentLimitsTest, StripsAreOfAsManyPixelsAsAllowed) {
  ViewRequest large = asked(1);
  large.view.width = large.view.height = 128;
  large.view.lens = Lens::from_fov_y(20, 128, 128);
  set("codec", "raw");
  const auto fragments = [&](const char* pixels) {
    set("strip-pixels", pixels);
    large.sequence = sequence_++;
    EXPECT_EQ(request(large), GST_FLOW_OK);
    return pull().fragments.size();
  };
  const size_t whole = fragments("65536"), strips = fragments("2048");
  EXPECT_EQ(whole, 1u);
  EXPECT_EQ(strips, 8u) << "128 rows of 128 pixels, 16 a strip";
}

TEST_F(FragmentLimitsTest, LensesThatTakeTooLongAreRefused) {
  set("max-pixels", "10000");
  ViewRequest strange = asked(2);
  strange.view.width = strange.view.height = 90;
  strange.view.lens = Lens(LensModel::kOpenCv, {1, 1, 45, 45, 1e12, -1e12, 1e9, 1e9});
  EXPECT_FALSE(is_answered(strange));
  strange.view.width = strange.view.height = 20;
  EXPECT_TRUE(is_answered(strange)) << "few pixels take little, whatever their lens is";
  EXPECT_EQ(stat(element_.get(), "refused-lens"), 1u);
  const std::vector<std::string> told = warnings();
  ASSERT_EQ(told.size(), 1u);
  EXPECT_THAT(told[0], HasSubstr("distortion"));
}

// Where another view takes long to plan, as of a strange lens, an ordinary one goes before the rest of the plan.
TEST_F(FragmentLimitsTest, OthersGoBeforeTheRestOfAStrangeLens) {
  gst_harness_set_live(harness_.get(), TRUE);
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  gst_harness_push_event(harness_.get(), gst_event_new_segment(&segment));
  set("max-delay", "60000000000");  // once the node knows what the lens takes it would skip it
  for (int i = 0; i < 5; i++) {     // the node learns how long answers of this view take
    EXPECT_EQ(request(asked(1)), GST_FLOW_OK);
    pull();
  }
  for (int i = 0; i < 3; i++) {
    ViewRequest strange = asked(2);
    strange.view.width = 1800;
    strange.view.height = 1100;
    strange.view.lens = Lens(LensModel::kOpenCv, {1, 1, 900.0 + i, 550, 1e12, -1e12, 1e9, 1e9});
    EXPECT_EQ(request(strange), GST_FLOW_OK);
    EXPECT_EQ(request(asked(1)), GST_FLOW_OK);
    EXPECT_EQ(pull().view_id, 1u) << i;
    EXPECT_EQ(pull().view_id, 2u) << i;
  }
}

TEST_F(FragmentLimitsTest, MoreViewsThanAllowedAreRefused) {
  set("max-views", "3");
  for (const uint32_t view : {5, 6, 7}) EXPECT_TRUE(is_answered(asked(view)));
  EXPECT_FALSE(is_answered(asked(8)));
  EXPECT_TRUE(is_answered(asked(6))) << "who is there stays";
  EXPECT_EQ(stat(element_.get(), "refused-views"), 1u);
}

TEST_F(FragmentLimitsTest, FilesAreAskedForAsFastAsTheyCanBeMade) {
  set("max-requests-per-second", "2");
  for (int i = 0; i < 10; i++) EXPECT_TRUE(is_answered(asked(1)));
}

// What few pixels, or none that show anything, took tells nothing of another view's: a second for each pixel would end
// all pictures.
TEST_F(FragmentLimitsTest, RequestsOfOnePixelTakeNobodysPictures) {
  gst_harness_set_live(harness_.get(), TRUE);
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  gst_harness_push_event(harness_.get(), gst_event_new_segment(&segment));
  set("max-delay", "20000000000");
  for (int i = 0; i < 20; i++) {
    ViewRequest tiny = asked(2);
    tiny.view.width = tiny.view.height = 1;
    tiny.view.lens = Lens::from_fov_y(20, 1, 1);
    EXPECT_EQ(request(tiny), GST_FLOW_OK);
    pull();
    ViewRequest ordinary = asked(1);
    ordinary.view.width = ordinary.view.height = 1500;
    ordinary.view.lens = Lens::from_fov_y(20, 1500, 1500);
    EXPECT_EQ(request(ordinary), GST_FLOW_OK);
    EXPECT_FALSE(pull().fragments.empty()) << i;
  }
  EXPECT_EQ(stat(element_.get(), "skipped"), 0u);
}

Bytes packet_of(const std::vector<Bytes>& units, uint16_t number) {
  Bytes payload(rtp::kUnitsHeaderBytes);
  rtp::put_units_header(payload.data());
  for (const Bytes& unit : units) payload.insert(payload.end(), unit.begin(), unit.end());
  GstBuffer* buffer = gst_rtp_buffer_new_allocate(static_cast<guint>(payload.size()), 0, 0);
  GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
  gst_rtp_buffer_map(buffer, GST_MAP_WRITE, &rtp);
  gst_rtp_buffer_set_seq(&rtp, number);
  gst_rtp_buffer_set_payload_type(&rtp, 96);
  std::copy(payload.begin(), payload.end(), static_cast<uint8_t*>(gst_rtp_buffer_get_payload(&rtp)));
  gst_rtp_buffer_unmap(&rtp);
  const BufferPtr owned(buffer);
  return to_bytes(buffer);
}

Bytes request_of(uint32_t view_id, uint32_t sequence, int size) {
  ViewRequest asked;
  asked.view_id = view_id;
  asked.sequence = sequence;
  asked.view.width = asked.view.height = size;
  return wire::encode_request(asked);
}

TEST(RtpLfDepayLimits, APacketHasNoMoreRequestsThanATurn) {
  RtpElement depay("rtplfdepay", kRtpRequestCaps);
  std::vector<Bytes> units;
  for (uint32_t i = 0; i < 200; i++) units.push_back(request_of(100 + i, 1, 1024));
  depay.push(packet_of(units, 1));
  EXPECT_EQ(depay.units(), (std::vector<Bytes>{units[197], units[198], units[199]}));
  EXPECT_EQ(stat(depay.element(), "superseded"), 197u);
}

TEST(RtpLfDepayLimits, RequestsBeyondALimitGoNoFurther) {
  RtpElement depay("rtplfdepay max-requests-per-second=5 max-views=2", kRtpRequestCaps);
  uint16_t number = 0;
  const auto passes = [&](uint32_t view_id, uint32_t sequence, int size) {
    depay.push(packet_of({request_of(view_id, sequence, size)}, ++number));
    return !depay.units().empty();
  };
  EXPECT_FALSE(passes(1, 1, kMaxImageSize));
  EXPECT_TRUE(passes(1, 2, 64));
  int passed = 0;
  for (uint32_t i = 0; i < 50; i++) passed += passes(2, 10 + i, 64);
  EXPECT_GE(passed, 5);
  EXPECT_FALSE(passes(3, 1, 64));
  EXPECT_EQ(stat(depay.element(), "refused-pixels"), 1u);
  EXPECT_EQ(stat(depay.element(), "refused-rate"), 50u - static_cast<unsigned>(passed));
  EXPECT_EQ(stat(depay.element(), "refused-views"), 1u);
  EXPECT_EQ(stat(depay.element(), "bad-units"), 0u);
}

TEST(RtpLfDepayLimits, AnswersOfLargerViewsGoNoFurther) {
  RtpElement depay("rtplfdepay max-pixels=1000", kRtpAnswerCaps);
  g_autoptr(GstBus) bus = gst_bus_new();
  gst_element_set_bus(depay.element(), bus);
  depay.push(packet_of({rtp::answer(1, 20, 20, 80)}, 1));
  EXPECT_THAT(depay.units(), IsEmpty());
  EXPECT_THAT(warnings_on(bus), HasSubstr("max-pixels (1000)"));
  gst_element_set_bus(depay.element(), nullptr);
  EXPECT_EQ(stat(depay.element(), "refused-pixels"), 1u);
}

}  // namespace
}  // namespace lf::test
