// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "../gst/common/common.h"
#include "gst/fragment_fixture.h"
#include "node/camera_access.h"
#include "support/answer_codec.h"
#include "support/seeing.h"
#include "wire/answer_parser.h"
#include "wire/command_codec.h"
#include "wire/request_codec.h"

namespace lf::test {
namespace {

using testing::HasSubstr;

TEST_F(LfFragmentTest, AnswersWithEveryCamerasContribution) {
  start(4);
  push_frames(200, 0);
  const ViewRequest asked = array_.request(5, 0);
  ASSERT_EQ(request(asked), GST_FLOW_OK);
  const wire::Answer answer = pull();
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

TEST_F(LfFragmentTest, EveryCodecHasEveryCamerasContribution) {
  start(4);
  push_frames(200, 0);
  const ViewRequest asked = array_.request(5, 0);
  for (const char* codec : {"auto", "raw", "raw16", "jpeg"}) {
    set("codec", codec);
    ASSERT_EQ(request(asked), GST_FLOW_OK);
    const wire::Answer answer = pull();
    EXPECT_GE(answer.fragments.size(), 1u) << codec;
    const auto [low, high] = picture_range(asked, answer);
    EXPECT_GE(low, 199) << codec;
    EXPECT_LE(high, 201) << codec;
  }
}

TEST_F(LfFragmentTest, AnswersWhatItsAccessIsFor) {
  start(4);
  push_frames(200, 0);
  const ViewRequest asked = array_.request(5, 0);
  const Mesh mesh = build_mesh(array_.rig());
  const auto push = [&](const std::vector<uint8_t>& bytes) {
    ASSERT_EQ(gst_harness_push(harness_.get(), to_buffer(bytes)), GST_FLOW_OK);
  };
  const auto push_all = [&] {
    push(wire::encode_request(asked));
    for (const Access access : {Access::kWarp, Access::kPixels})
      push(wire::encode_any_request(CameraAccess::of(access)->command(array_.rig(), mesh, asked)));
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

TEST_F(LfFragmentTest, CommandsThatDoNotFitAreAnsweredWithNothing) {
  start(4);
  push_frames(200, 0);
  set("access", "pixels");
  const ViewRequest asked = array_.request(5, 0);
  const int width = ArrayFixture::kWidth;
  wire::PixelCommand command{asked, 16, 12, {{2, {width - 2, 0, width + 2, 2}}}};
  ASSERT_EQ(gst_harness_push(harness_.get(), to_buffer(wire::encode_command(command))), GST_FLOW_OK);
  EXPECT_TRUE(pull().fragments.empty());
  EXPECT_EQ(stat(element_.get(), "bad-requests"), 1u);
  command.rig_hash ^= 1;
  ASSERT_EQ(gst_harness_push(harness_.get(), to_buffer(wire::encode_command(command))), GST_FLOW_OK);
  EXPECT_TRUE(pull().fragments.empty());
  EXPECT_EQ(stat(element_.get(), "rig-mismatches"), 1u);
}

TEST_F(LfFragmentTest, ThreadsDoNotShowInTheAnswer) {
  start(4);
  push_frames(137, 0);
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
    EXPECT_THAT(answers, testing::Each(answers[0])) << codec;
  }
}

TEST_F(LfFragmentTest, InASumACameraWithoutAFrameIsLost) {
  start(4, "RGB", true);
  gst_element_set_state(element_.get(), GST_STATE_READY);
  for (int i = 0; i < 4; i++) {
    const std::string property = "sink_" + std::to_string(i) + "::camera";
    gst_child_proxy_set(GST_CHILD_PROXY(element_.get()), property.c_str(), i, nullptr);
  }
  gst_element_set_state(element_.get(), GST_STATE_PLAYING);
  for (size_t i = 1; i < 4; i++)
    ASSERT_EQ(gst_harness_push(cameras_[i].get(), ArrayFixture::frame("RGB", 200, 0)), GST_FLOW_OK);
  gst_harness_set_live(harness_.get(), TRUE);
  const ViewRequest asked = array_.request(5, 0);
  ASSERT_EQ(request(asked), GST_FLOW_OK);
  const wire::Answer answer = pull();
  EXPECT_TRUE(std::ranges::any_of(answer.fragments, [](const Fragment& f) { return !f.lost.empty(); }));
  EXPECT_EQ(seeing(answer), (std::vector<CameraIndex>{1, 2, 3}));
  EXPECT_GE(picture_range(asked, answer).first, 195) << "the others make up for it";
}

TEST_F(LfFragmentTest, JpegIsOfTheQualityAskedFor) {
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

GstPadProbeReturn note_codec(GstPad*, GstPadProbeInfo* info, gpointer data) {
  const std::vector<uint8_t> bytes = to_bytes(GST_PAD_PROBE_INFO_BUFFER(info));
  const auto answer = wire::parse_answer(bytes);
  if (answer && !answer->fragments.empty()) *static_cast<wire::Codec*>(data) = answer->fragments[0].codec;
  return GST_PAD_PROBE_OK;
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
    const ElementPtr pipeline =
        launch("lfviewrequest num-buffers=3 framerate=15/1 rig=" + array_.rig_path() +
               " ! tee name=r  r. ! queue ! n.request  lfcameranode name=n rig=" + array_.rig_path() + " ! " +
               test.downstream + "  r. ! queue ! c.request  lfcompositor name=c ! fakesink");
    ASSERT_TRUE(pipeline) << test.downstream;
    const ElementPtr node(gst_bin_get_by_name(GST_BIN(pipeline.get()), "n"));
    GstPad* src = gst_element_get_static_pad(node.get(), "src");
    wire::Codec codec = wire::Codec::kRaw;
    gst_pad_add_probe(src, GST_PAD_PROBE_TYPE_BUFFER, note_codec, &codec, nullptr);
    gst_object_unref(src);
    EXPECT_EQ(run(pipeline.get(), 10), "") << test.downstream;
    EXPECT_EQ(codec, test.codec) << test.downstream;
  }
}

TEST_F(LfFragmentTest, AnswersCarryTheRequestsTimestamp) {
  start(4);
  push_frames(10, 0);
  push_frames(20, kFrame);
  ASSERT_EQ(request(array_.request(0, kFrame)), GST_FLOW_OK);
  pull();
  EXPECT_EQ(last_pts_, kFrame);
}

TEST_F(LfFragmentTest, AnotherRigsRequestGetsNoPicture) {
  start(4);
  push_frames(10, 0);
  ViewRequest foreign = array_.request(0, 0);
  foreign.rig_hash ^= 1;
  ASSERT_EQ(request(foreign), GST_FLOW_OK);
  EXPECT_TRUE(pull().fragments.empty());
  EXPECT_EQ(stat(element_.get(), "rig-mismatches"), 1u);
}

TEST_F(LfFragmentTest, GarbageIsCountedAndDropped) {
  start(4);
  push_frames(10, 0);
  ASSERT_EQ(gst_harness_push(harness_.get(), to_buffer({1, 2, 3})), GST_FLOW_OK);
  EXPECT_EQ(gst_harness_buffers_in_queue(harness_.get()), 0u);
  EXPECT_EQ(stat(element_.get(), "bad-requests"), 1u);
  ViewRequest unknown_camera = array_.request(1, 0);
  unknown_camera.out_of_service = {99};
  ASSERT_EQ(request(unknown_camera), GST_FLOW_OK);
  EXPECT_TRUE(pull().fragments.empty());
  EXPECT_EQ(stat(element_.get(), "bad-requests"), 2u);
}

TEST_F(LfFragmentTest, EosOfTheRequestsEndsAnswersAndCameras) {
  start(4);
  push_frames(10, 0);
  gst_harness_push_event(harness_.get(), gst_event_new_eos());
  while (GstEvent* event = gst_harness_try_pull_event(harness_.get())) {
    const bool eos = GST_EVENT_TYPE(event) == GST_EVENT_EOS;
    gst_event_unref(event);
    if (eos) break;
  }
  EXPECT_EQ(gst_harness_push(cameras_[0].get(), ArrayFixture::frame("RGB", 1, kFrame)), GST_FLOW_EOS);
}

TEST_F(LfFragmentTest, CameraLatencyStaysOutOfTheRequestPath) {
  start(1, "RGB", true);
  gst_harness_set_upstream_latency(cameras_[0].get(), 200 * GST_MSECOND);
  gst_harness_set_live(harness_.get(), TRUE);
  EXPECT_EQ(gst_harness_query_latency(harness_.get()), 0u);
}

TEST_F(LfFragmentTest, FurtherRequestersHaveTheirOwnPads) {
  start(4);
  push_frames(77, 0);
  const HarnessPtr second(gst_harness_new_with_element(element_.get(), "request_3", "src_3"));
  gst_harness_set_src_caps_str(second.get(), "application/x-lightfield-request");
  ASSERT_EQ(gst_harness_push(second.get(), to_buffer(wire::encode_request(array_.request(9, 0)))), GST_FLOW_OK);
  const BufferPtr buffer(gst_harness_pull(second.get()));
  ASSERT_TRUE(buffer);
  EXPECT_EQ(wire::decode_answer(to_bytes(buffer.get()))->sequence, 9u);
  EXPECT_EQ(gst_harness_buffers_in_queue(harness_.get()), 0u);
}

TEST_F(LfFragmentTest, ErrorsNameThePlace) {
  const struct {
    std::string line, message;
  } cases[] = {
      {"lffragment ! fakesink", "set the property \"rig\""},
      {"lffragment rig=/nowhere/rig.json ! fakesink", "/nowhere/rig.json"},
      {"videotestsrc num-buffers=1 ! video/x-raw,format=RGB,width=31,height=24 ! n.sink_0 lffragment name=n rig=" +
           array_.rig_path() + " ! fakesink",
       "31x24 pixels, the rig " + array_.rig_path() + " says 32x24"},
      {"videotestsrc num-buffers=1 ! video/x-raw,format=RGB,width=32,height=24 ! n.sink_9 lffragment name=n rig=" +
           array_.rig_path() + " ! fakesink",
       "has no camera 9"},
      {"videotestsrc num-buffers=1 ! video/x-raw,width=48,height=24 ! jpegenc ! n.sink_0 lffragment name=n rig=" +
           array_.rig_path() + " ! fakesink",
       "48x24 pixels, the rig " + array_.rig_path() + " says 32x24"},
  };
  for (const auto& test : cases) {
    const ElementPtr pipeline = launch(test.line);
    ASSERT_TRUE(pipeline) << test.line;
    EXPECT_THAT(run(pipeline.get(), 5), HasSubstr(test.message)) << test.line;
  }
}

TEST_F(LfFragmentTest, TheStreamSaysWhichCameraItIs) {
  start(1);  // on sink_0
  GstStructure* name = gst_structure_new(LF_CAMERA_EVENT, "camera", G_TYPE_UINT, 3u, nullptr);
  gst_harness_push_event(cameras_[0].get(), gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM_STICKY, name));
  push_frames(60, 0);
  ASSERT_EQ(request(array_.request(0, 0)), GST_FLOW_OK);
  const wire::Answer answer = pull();
  EXPECT_FALSE(answer.fragments.empty());
  EXPECT_EQ(seeing(answer), std::vector<CameraIndex>{3});
}

}  // namespace
}  // namespace lf::test
