// SPDX-License-Identifier: LGPL-2.1-or-later
#include "../gst/common/common.h"
#include "gst/fragment_fixture.h"
#include "gst/rtp_fixture.h"
#include "node/camera_access.h"

namespace lf::test {
namespace {

TEST_F(LfFragmentTest, AnswersContainAllCameras) {
  start_showing(200);
  const ViewRequest asked = array_.request(5, 0);
  const wire::Answer answer = answer_to(asked);
  EXPECT_EQ(answer.sequence, 5u);
  EXPECT_EQ(answer.node, 7u);
  EXPECT_EQ(answer.rig_hash, array_.rig().hash());
  EXPECT_TRUE(answer.last_of_node);
  EXPECT_EQ(answer.actual_time, 0u);
  EXPECT_EQ(seeing(answer), (std::vector<CameraIndex>{0, 1, 2, 3}));
  const auto [low, high] = picture_range(asked, answer);
  EXPECT_GE(low, 199);
  EXPECT_LE(high, 201);
}

TEST_F(LfFragmentTest, AnswersContainAllCamerasWithEveryCodec) {
  start_showing(200);
  const ViewRequest asked = array_.request(5, 0);
  for (const char* codec : {"auto", "raw", "raw16", "jpeg"}) {
    set("codec", codec);
    const wire::Answer answer = answer_to(asked);
    EXPECT_GE(answer.fragments.size(), 1u) << codec;
    const auto [low, high] = picture_range(asked, answer);
    EXPECT_GE(low, 199) << codec;
    EXPECT_LE(high, 201) << codec;
  }
}

TEST_F(LfFragmentTest, AnswersOnlyRequestsOfItsAccess) {
  start_showing(200);
  const ViewRequest asked = array_.request(5, 0);
  const Mesh mesh = build_mesh(array_.rig());
  const auto push_all = [&] {
    ASSERT_EQ(push(wire::encode_request(asked)), GST_FLOW_OK);
    for (const Access access : {Access::kWarp, Access::kPixels}) {
      const wire::AnyRequest command = CameraAccess::of(access)->command(array_.rig(), mesh, asked);
      ASSERT_EQ(push(wire::encode_any_request(command)), GST_FLOW_OK);
    }
  };
  const auto pull_bytes = [&] {
    const BufferPtr buffer(gst_harness_pull(harness_.get()));
    EXPECT_TRUE(buffer);
    EXPECT_FALSE(BufferPtr(gst_harness_try_pull(harness_.get()))) << "one answer";
    return buffer ? to_bytes(buffer.get()) : std::vector<uint8_t>();
  };
  push_all();
  const std::vector<uint8_t> self = pull_bytes();
  set("access", "warp");
  push_all();
  EXPECT_EQ(pull_bytes(), self);
  set("access", "pixels");
  push_all();
  const std::vector<uint8_t> bytes = pull_bytes();
  const auto pixels = wire::parse_answer(bytes);
  ASSERT_TRUE(pixels);
  EXPECT_EQ(pixels->fragments.size(), 4u);
  EXPECT_EQ(pixels->cameras.size(), 4u);
  EXPECT_TRUE(pixels->last_of_node);
  EXPECT_TRUE(std::ranges::all_of(pixels->fragments, [](const auto& fragment) { return fragment.camera.has_value(); }));
  EXPECT_EQ(stat(element_.get(), "bad-requests"), 0u);
}

TEST_F(LfFragmentTest, UnfitCommandsGetEmptyAnswers) {
  start_showing(200);
  set("access", "pixels");
  const ViewRequest asked = array_.request(5, 0);
  const int width = ArrayFixture::kWidth;
  wire::PixelCommand command{asked, 16, 12, {{2, {width - 2, 0, width + 2, 2}}}};
  ASSERT_EQ(push(wire::encode_command(command)), GST_FLOW_OK);
  EXPECT_TRUE(pull().fragments.empty());
  EXPECT_EQ(stat(element_.get(), "bad-requests"), 1u);
  command.rig_hash ^= 1;
  ASSERT_EQ(push(wire::encode_command(command)), GST_FLOW_OK);
  EXPECT_TRUE(pull().fragments.empty());
  EXPECT_EQ(stat(element_.get(), "rig-mismatches"), 1u);
}

TEST_F(LfFragmentTest, AnswersDoNotDependOnThreads) {
  start_showing(137);
  const ViewRequest asked = array_.request(5, 0);
  for (const char* codec : {"raw16", "jpeg"}) {
    set("codec", codec);
    std::vector<std::vector<uint8_t>> answers;
    for (const char* threads : {"1", "2", "7", "0"}) {
      set("threads", threads);
      ASSERT_EQ(request(asked), GST_FLOW_OK);
      const BufferPtr buffer(gst_harness_pull(harness_.get()));
      answers.push_back(to_bytes(buffer.get()));
    }
    EXPECT_THAT(answers, Each(answers[0])) << codec;
  }
}

TEST_F(LfFragmentTest, CameraWithoutFrameIsMissingInTheSum) {
  start(4, "RGB", true);
  gst_element_set_state(element_.get(), GST_STATE_READY);
  for (int i = 0; i < 4; i++) {
    const std::string property = "sink_" + std::to_string(i) + "::camera";
    gst_child_proxy_set(GST_CHILD_PROXY(element_.get()), property.c_str(), i, nullptr);
  }
  gst_element_set_state(element_.get(), GST_STATE_PLAYING);
  for (size_t i = 1; i < 4; i++) push_frame(cameras_[i], 200, 0);
  gst_harness_set_live(harness_.get(), TRUE);
  const ViewRequest asked = array_.request(5, 0);
  const wire::Answer answer = answer_to(asked);
  EXPECT_TRUE(std::ranges::any_of(answer.fragments, [](const Fragment& f) { return !f.lost.empty(); }));
  EXPECT_EQ(seeing(answer), (std::vector<CameraIndex>{1, 2, 3}));
  EXPECT_GE(picture_range(asked, answer).first, 195) << "other cameras fill in";
}

TEST_F(LfFragmentTest, JpegHasTheRequestedQuality) {
  start(4);
  set("codec", "jpeg");
  push_frames(200, 0);
  for (const uint8_t quality : {uint8_t{0}, uint8_t{90}, uint8_t{40}}) {
    ViewRequest asked = array_.request(quality, 0);
    asked.quality = quality;
    ASSERT_EQ(request(asked), GST_FLOW_OK);
    const BufferPtr buffer(gst_harness_pull(harness_.get()));
    ASSERT_TRUE(buffer);
    const std::vector<uint8_t> bytes = to_bytes(buffer.get());
    const auto answer = wire::parse_answer(bytes);
    ASSERT_TRUE(answer);
    for (const wire::FragmentView& fragment : answer->fragments) {
      EXPECT_EQ(fragment.codec == wire::Codec::kJpeg, quality > 0);
      EXPECT_EQ(fragment.quality, quality);
    }
  }
}

TEST_F(LfFragmentTest, CodecFollowsTheLink) {
  const struct {
    const char* downstream;
    wire::Codec codec;
  } cases[] = {
      {"tee ! queue ! identity ! c.sink_0", wire::Codec::kRaw16},
      {"queue ! fakesink", wire::Codec::kJpeg},
  };
  for (const auto& test : cases) {
    const PipelinePtr pipeline =
        launch("lfviewrequest num-buffers=3 framerate=15/1 rig=" + array_.rig_path() +
               " ! tee name=r  r. ! queue ! n.request  lfcameranode name=n rig=" + array_.rig_path() + " ! " +
               test.downstream + "  r. ! queue ! c.request  lfcompositor name=c ! fakesink");
    wire::Codec codec = wire::Codec::kRaw;
    on_buffers(child_of(pipeline.get(), "n").get(), "src", [&](GstBuffer* buffer) {
      const std::vector<uint8_t> bytes = to_bytes(buffer);
      const auto answer = wire::parse_answer(bytes);
      if (answer && !answer->fragments.empty()) codec = answer->fragments[0].codec;
    });
    EXPECT_EQ(run(pipeline.get(), 10), "") << test.downstream;
    EXPECT_EQ(codec, test.codec) << test.downstream;
  }
}

TEST_F(LfFragmentTest, AnswersCarryTheRequestsTimestamp) {
  start_showing(10);
  push_frames(20, kFrame);
  ASSERT_EQ(request(array_.request(0, kFrame)), GST_FLOW_OK);
  pull();
  EXPECT_EQ(last_pts_, kFrame);
}

TEST_F(LfFragmentTest, RequestForAnotherRigGetsNoPicture) {
  start_showing(10);
  ViewRequest foreign = array_.request(0, 0);
  foreign.rig_hash ^= 1;
  EXPECT_TRUE(answer_to(foreign).fragments.empty());
  EXPECT_EQ(stat(element_.get(), "rig-mismatches"), 1u);
}

TEST_F(LfFragmentTest, GarbageIsCountedAndDropped) {
  start_showing(10);
  ASSERT_EQ(push({1, 2, 3}), GST_FLOW_OK);
  EXPECT_EQ(gst_harness_buffers_in_queue(harness_.get()), 0u);
  EXPECT_EQ(stat(element_.get(), "bad-requests"), 1u);
  ViewRequest unknown_camera = array_.request(1, 0);
  unknown_camera.out_of_service = {99};
  EXPECT_TRUE(answer_to(unknown_camera).fragments.empty());
  EXPECT_EQ(stat(element_.get(), "bad-requests"), 2u);
}

TEST_F(LfFragmentTest, EosOfTheRequestsEndsAnswersAndCameras) {
  start_showing(10);
  gst_harness_push_event(harness_.get(), gst_event_new_eos());
  while (const EventPtr event{gst_harness_try_pull_event(harness_.get())})
    if (GST_EVENT_TYPE(event.get()) == GST_EVENT_EOS) break;
  EXPECT_EQ(gst_harness_push(cameras_[0].get(), ArrayFixture::frame("RGB", 1, kFrame)), GST_FLOW_EOS);
}

TEST_F(LfFragmentTest, CameraLatencyDoesNotAffectRequests) {
  start(1, "RGB", true);
  gst_harness_set_upstream_latency(cameras_[0].get(), 200 * GST_MSECOND);
  gst_harness_set_live(harness_.get(), TRUE);
  EXPECT_EQ(gst_harness_query_latency(harness_.get()), 0u);
}

TEST_F(LfFragmentTest, FurtherClientsHaveSeparatePads) {
  start_showing(77);
  const HarnessPtr second(gst_harness_new_with_element(element_.get(), "request_3", "src_3"));
  gst_harness_set_src_caps_str(second.get(), "application/x-lightfield-request");
  ASSERT_EQ(gst_harness_push(second.get(), to_buffer(wire::encode_request(array_.request(9, 0)))), GST_FLOW_OK);
  const BufferPtr buffer(gst_harness_pull(second.get()));
  ASSERT_TRUE(buffer);
  EXPECT_EQ(wire::decode_answer(to_bytes(buffer.get()))->sequence, 9u);
  EXPECT_EQ(gst_harness_buffers_in_queue(harness_.get()), 0u);
}

TEST_F(LfFragmentTest, ErrorsNameThePlace) {
  const std::string node = " lffragment name=n rig=" + array_.rig_path() + " ! fakesink",
                    video = "videotestsrc num-buffers=1 ! video/x-raw,";
  const std::pair<std::string, std::vector<std::string>> cases[] = {
      {"lffragment ! fakesink", {"property", "\"rig\""}},
      {"lffragment rig=/nowhere/rig.json ! fakesink", {"/nowhere/rig.json"}},
      {video + "format=RGB,width=31,height=24 ! n.sink_0" + node, {"31x24", array_.rig_path(), "32x24"}},
      {video + "format=RGB,width=32,height=24 ! n.sink_9" + node, {"camera 9"}},
      {video + "width=48,height=24 ! jpegenc ! n.sink_0" + node, {"48x24", array_.rig_path(), "32x24"}},
  };
  for (const auto& [line, facts] : cases) EXPECT_THAT(run(line, 5), mentions(facts)) << line;
}

TEST_F(LfFragmentTest, StreamNamesItsCamera) {
  start(1);
  GstStructure* name = gst_structure_new(LF_CAMERA_EVENT, "camera", G_TYPE_UINT, 3u, nullptr);
  gst_harness_push_event(cameras_[0].get(), gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM_STICKY, name));
  push_frames(60, 0);
  const wire::Answer answer = answer_to(array_.request(0, 0));
  EXPECT_FALSE(answer.fragments.empty());
  EXPECT_EQ(seeing(answer), std::vector<CameraIndex>{3});
}

// --- Limits ----------------------------------------------------------------------------------------------------------
// Requests beyond a limit are dropped, counted and reported before they cost anything.

class FragmentLimitsTest : public LfFragmentTest {
 protected:
  void SetUp() override {
    start_showing(100);
    end_cameras();
    listen();
  }
  ViewRequest asked(uint32_t view_id) { return array_.request(sequence_++, 0, view_id); }
  bool is_answered(const ViewRequest& asked) {
    EXPECT_EQ(request(asked), GST_FLOW_OK);
    return BufferPtr(gst_harness_try_pull(harness_.get())) != nullptr;
  }
  uint32_t sequence_ = 0;
};

TEST_F(FragmentLimitsTest, ExpensiveRequestsAreRefusedAndCounted) {
  EXPECT_TRUE(is_answered(asked(1)));
  ViewRequest large = asked(2);
  large.view.width = large.view.height = kMaxImageSize;
  EXPECT_FALSE(is_answered(large));
  ViewRequest wide = asked(3);
  wide.view.blending = {Blending::Kind::kAperture, 1e6, 0};
  EXPECT_FALSE(is_answered(wide));
  wide.view.blending.aperture = 0.05;
  EXPECT_TRUE(is_answered(wide));
  set("limits", "limits,max-aperture=0.01");
  EXPECT_FALSE(is_answered(wide));
  set("limits", "limits,max-pixels=100,max-aperture=0.01");
  EXPECT_FALSE(is_answered(asked(1)));
  set("limits", "limits,max-pixels=1000000");
  EXPECT_TRUE(is_answered(asked(1)));
  EXPECT_EQ(stat(element_.get(), "refused-pixels"), 2u);
  EXPECT_EQ(stat(element_.get(), "refused-aperture"), 2u);
  EXPECT_EQ(stat(element_.get(), "refused"), 4u);
  EXPECT_EQ(stat(element_.get(), "bad-requests"), 0u);
  // At most once a second.
  const std::vector<std::string> told = warnings();
  ASSERT_GE(told.size(), 1u);
  EXPECT_THAT(told[0], AllOf(mentions("View 2", "16384x16384"), HasSubstr("max-pixels")));
  EXPECT_LT(told.size(), 4u);
}

TEST_F(FragmentLimitsTest, MoreHypothesesThanAllowedAreRefused) {
  ViewRequest curious = asked(1);
  curious.view.focus.map = flat_surface(curious.view);
  curious.hypotheses = {{DepthHypothesis::Kind::kBlurred, 0}, {DepthHypothesis::Kind::kPlane, 200}};
  set("limits", "limits,max-hypotheses=1");
  EXPECT_FALSE(is_answered(curious));
  EXPECT_EQ(stat(element_.get(), "refused-hypotheses"), 1u);
  set("limits", "limits,max-hypotheses=2");
  curious.sequence = sequence_++;
  EXPECT_TRUE(is_answered(curious));
}

TEST_F(FragmentLimitsTest, WrongLimitsAreReportedAndIgnored) {
  set("limits", "limits,max-pixels=0,max-views=1,max-cameras=4");
  EXPECT_THAT(warnings(), ElementsAre(mentions("limits", "max-pixels", "1 to 268435456", "0"),
                                      mentions("limits", "max-cameras", "no such")));
  EXPECT_TRUE(is_answered(asked(1))) << "max-pixels is at its default";
  EXPECT_FALSE(is_answered(asked(2)));
  set("limits", "limits");
  EXPECT_TRUE(is_answered(asked(2)));
  EXPECT_THAT(warnings(), ElementsAre(HasSubstr("max-views")));
}

// Without a bus the message would be lost.
TEST_F(LfFragmentTest, WrongLimitsAreReportedAtStart) {
  const PipelinePtr fragment = launch("lffragment rig=" + array_.rig_path() + " limits=limits,max-views=none");
  const ElementBus bus(fragment.get());
  EXPECT_EQ(gst_element_set_state(fragment.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_SUCCESS);
  EXPECT_THAT(bus.warnings(), mentions("max-views", "1 to 65536", "none"));
}

TEST_F(FragmentLimitsTest, AnswersArePostedIfRequested) {
  EXPECT_TRUE(is_answered(asked(3)));
  EXPECT_EQ(gst_bus_pop_filtered(bus_.get(), GST_MESSAGE_ELEMENT), nullptr);
  set("post-messages", "true");
  const ViewRequest second = asked(4);
  EXPECT_TRUE(is_answered(second));
  const MessagePtr message(gst_bus_pop_filtered(bus_.get(), GST_MESSAGE_ELEMENT));
  ASSERT_TRUE(message);
  const GstStructure* answer = gst_message_get_structure(message.get());
  EXPECT_STREQ(gst_structure_get_name(answer), "lightfield-answer");
  guint view = 0, sequence = 0, fragments = 0;
  guint64 bytes = 0;
  EXPECT_TRUE(gst_structure_get(answer, "view-id", G_TYPE_UINT, &view, "sequence", G_TYPE_UINT, &sequence, "fragments",
                                G_TYPE_UINT, &fragments, "bytes", G_TYPE_UINT64, &bytes, nullptr));
  EXPECT_EQ(view, 4u);
  EXPECT_EQ(sequence, second.sequence);
  EXPECT_GT(fragments, 0u);
  EXPECT_GT(bytes, 0u);
}

// Smaller strips lose less with a lost packet; the minimum is 16 rows.
TEST_F(FragmentLimitsTest, StripsHaveLimitedPixels) {
  ViewRequest large = asked(1);
  large.view.width = large.view.height = 128;
  large.view.lens = Lens::from_fov_y(20, 128, 128);
  set("codec", "raw");
  const auto fragments = [&](const char* pixels) {
    set("strip-pixels", pixels);
    large.sequence = sequence_++;
    return answer_to(large).fragments.size();
  };
  const size_t whole = fragments("65536"), strips = fragments("2048");
  EXPECT_EQ(whole, 1u);
  EXPECT_EQ(strips, 8u) << "128 rows of 128 pixels, 16 a strip";
}

TEST_F(FragmentLimitsTest, ExpensiveLensesAreRefused) {
  set("limits", "limits,max-pixels=10000");
  ViewRequest strange = asked(2);
  strange.view.width = strange.view.height = 90;
  strange.view.lens = Lens(LensModel::kOpenCv, {1, 1, 45, 45, 1e12, -1e12, 1e9, 1e9});
  EXPECT_FALSE(is_answered(strange));
  strange.view.width = strange.view.height = 20;
  EXPECT_TRUE(is_answered(strange)) << "few pixels are cheap with any lens";
  EXPECT_EQ(stat(element_.get(), "refused-lens"), 1u);
  EXPECT_THAT(warnings(), ElementsAre(HasSubstr("distortion")));
}

// An ordinary view is served between the steps of planning a view with an extreme lens.
TEST_F(FragmentLimitsTest, OtherViewsInterruptAnExpensiveLens) {
  make_live();
  // a shorter limit would skip the view as soon as its rendering time is measured
  set("max-delay", "60000000000");
  for (int i = 0; i < 5; i++) answer_to(asked(1));
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
  set("limits", "limits,max-views=3");
  for (const uint32_t view : {5, 6, 7}) EXPECT_TRUE(is_answered(asked(view)));
  EXPECT_FALSE(is_answered(asked(8)));
  EXPECT_TRUE(is_answered(asked(6))) << "existing views stay";
  EXPECT_EQ(stat(element_.get(), "refused-views"), 1u);
}

TEST_F(FragmentLimitsTest, NonLiveRequestsHaveNoRateLimit) {
  set("limits", "limits,max-requests-per-second=2");
  for (int i = 0; i < 10; i++) EXPECT_TRUE(is_answered(asked(1)));
}

// The rendering time of a view with few or no visible pixels must not predict other views: a second per pixel would
// stop all pictures.
TEST_F(FragmentLimitsTest, TinyRequestsDoNotAffectOtherViews) {
  make_live();
  set("max-delay", "20000000000");
  for (int i = 0; i < 20; i++) {
    ViewRequest tiny = asked(2);
    tiny.view.width = tiny.view.height = 1;
    tiny.view.lens = Lens::from_fov_y(20, 1, 1);
    answer_to(tiny);
    ViewRequest ordinary = asked(1);
    ordinary.view.width = ordinary.view.height = 1500;
    ordinary.view.lens = Lens::from_fov_y(20, 1500, 1500);
    EXPECT_FALSE(answer_to(ordinary).fragments.empty()) << i;
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

TEST(RtpLfDepayLimits, PacketsHaveLimitedRequests) {
  RtpElement depay("rtplfdepay", kRtpRequestCaps);
  std::vector<Bytes> units;
  for (uint32_t i = 0; i < 200; i++) units.push_back(request_of(100 + i, 1, 1024));
  depay.push(packet_of(units, 1));
  EXPECT_EQ(depay.units(), (std::vector<Bytes>{units[197], units[198], units[199]}));
  EXPECT_EQ(stat(depay.element(), "superseded"), 197u);
}

TEST(RtpLfDepayLimits, RequestsBeyondALimitAreDropped) {
  RtpElement depay("rtplfdepay limits=limits,max-requests-per-second=5,max-views=2", kRtpRequestCaps);
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

TEST(RtpLfDepayLimits, AnswersOfTooLargeViewsAreDropped) {
  RtpElement depay("rtplfdepay limits=limits,max-pixels=1000", kRtpAnswerCaps);
  const ElementBus bus(depay.element());
  depay.push(packet_of({rtp::answer(1, 20, 20, 80)}, 1));
  EXPECT_THAT(depay.units(), IsEmpty());
  EXPECT_THAT(bus.warnings(), HasSubstr("max-pixels (1000)"));
  EXPECT_EQ(stat(depay.element(), "refused-pixels"), 1u);
}

// --- Quality of service ----------------------------------------------------------------------------------------------
// QoS events report late pictures; the node skips requests that would be late.

using LfFragmentQosTest = LfFragmentTest;

TEST_F(LfFragmentQosTest, LateRequestsAreAnsweredWithoutFragments) {
  start_showing(100);
  end_cameras();
  const auto answer_for = [&](uint32_t sequence, uint32_t view_id) {
    return answer_to(array_.request(sequence, sequence * kFrame, view_id));
  };
  EXPECT_FALSE(answer_for(0, 3).fragments.empty());
  GstEvent* late = gst_event_new_qos(GST_QOS_TYPE_UNDERFLOW, 2, kFrame, 0);
  gst_structure_set(gst_event_writable_structure(late), "lightfield-view-id", G_TYPE_UINT, 3u, nullptr);
  gst_harness_push_upstream_event(harness_.get(), late);  // skips two frames to catch up
  const wire::Answer skipped = answer_for(1, 3);
  EXPECT_TRUE(skipped.fragments.empty());
  EXPECT_EQ(skipped.sequence, 1u);
  EXPECT_EQ(skipped.rig_hash, array_.rig().hash());
  EXPECT_FALSE(answer_for(1, 4).fragments.empty()) << "another view is not late";
  EXPECT_FALSE(answer_for(2, 3).fragments.empty());
  EXPECT_EQ(stat(element_.get(), "skipped"), 1u);
  EXPECT_EQ(stat(element_.get(), "answers"), 4u);
  EXPECT_EQ(stat(element_.get(), "missing-frames"), 0u);
}

}  // namespace
}  // namespace lf::test
