// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <random>
#include <thread>

#include "../gst/common.h"
#include "base/schedule.h"
#include "gst/fragment_fixture.h"
#include "image/image_io.h"
#include "node/commands.h"
#include "support/add_answer.h"
#include "wire/answer_codec.h"
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
  EXPECT_EQ(answer.fragments.size(), 4u);
  const auto [low, high] = picture_range(asked, answer);
  EXPECT_GE(low, 199);  // three roundings
  EXPECT_LE(high, 201);
}

TEST_F(LfFragmentTest, ASumHasEveryCamerasContribution) {
  start(4);
  set("sum", "auto");  // the cameras' rectangles are most of the view each
  push_frames(200, 0);
  const ViewRequest asked = array_.request(5, 0);
  for (const char* codec : {"auto", "raw", "raw16", "jpeg"}) {
    set("codec", codec);
    ASSERT_EQ(request(asked), GST_FLOW_OK);
    const wire::Answer answer = pull();
    ASSERT_EQ(answer.fragments.size(), 1u) << codec;
    EXPECT_EQ(answer.fragments[0].camera, Fragment::kSum) << codec;
    const auto [low, high] = picture_range(asked, answer);
    EXPECT_GE(low, 199) << codec;
    EXPECT_LE(high, 201) << codec;
  }
}

TEST_F(LfFragmentTest, AnswersWhatItsAccessIsFor) {
  start(4);
  set("sum", "node");
  push_frames(200, 0);
  const ViewRequest asked = array_.request(5, 0);
  const Mesh mesh = build_mesh(array_.rig());
  const auto push = [&](const std::vector<uint8_t>& bytes) {
    ASSERT_EQ(gst_harness_push(harness_.get(), to_buffer(bytes)), GST_FLOW_OK);
  };
  const auto push_all = [&] {
    push(wire::encode_request(asked));
    push(wire::encode_command(warp_command(array_.rig(), mesh, asked)));
    push(wire::encode_command(pixel_command(array_.rig(), mesh, asked)));
  };
  const auto pull_bytes = [&] {
    const BufferPtr buffer(gst_harness_try_pull(harness_.get()));
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
  EXPECT_TRUE(std::ranges::all_of(pixels->fragments, &wire::FragmentView::plain));
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
  for (const char* sum : {"node", "camera"}) {
    set("sum", sum);
    std::vector<std::vector<uint8_t>> answers;
    for (const char* threads : {"1", "2", "7", "0"}) {
      set("threads", threads);
      ASSERT_EQ(request(asked), GST_FLOW_OK);
      const BufferPtr buffer(gst_harness_try_pull(harness_.get()));
      answers.push_back(to_bytes(buffer.get()));
    }
    EXPECT_THAT(answers, testing::Each(answers[0])) << sum;
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
  set("sum", "node");
  for (size_t i = 1; i < 4; i++)
    ASSERT_EQ(gst_harness_push(cameras_[i].get(), ArrayFixture::frame("RGB", 200, 0)), GST_FLOW_OK);
  gst_harness_set_live(harness_.get(), TRUE);
  const ViewRequest asked = array_.request(5, 0);
  ASSERT_EQ(request(asked), GST_FLOW_OK);
  const wire::Answer answer = pull();
  ASSERT_EQ(answer.fragments.size(), 1u);
  EXPECT_FALSE(answer.fragments[0].lost.empty());
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
    const BufferPtr buffer(gst_harness_try_pull(harness_.get()));
    ASSERT_TRUE(buffer);
    const std::vector<uint8_t> bytes = to_bytes(buffer.get());
    const auto answer = wire::parse_answer(bytes);
    ASSERT_TRUE(answer);
    for (const wire::FragmentView& fragment : answer->fragments) {
      EXPECT_EQ(wire::is_jpeg(fragment.codec), quality > 0);
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

TEST_F(LfFragmentTest, TakesTheFrameNearestToTheRequestedTime) {
  start(4);
  push_frames(10, 0);
  push_frames(250, kFrame);
  const ViewRequest early = array_.request(0, kFrame * 4 / 10), late = array_.request(1, kFrame * 6 / 10);
  ASSERT_EQ(request(early), GST_FLOW_OK);
  const wire::Answer first = pull();
  EXPECT_EQ(first.actual_time, 0u);
  EXPECT_LE(picture_range(early, first).second, 11);
  ASSERT_EQ(request(late), GST_FLOW_OK);
  const wire::Answer second = pull();
  EXPECT_EQ(second.actual_time, kFrame);
  EXPECT_GE(picture_range(late, second).first, 248);
}

TEST_F(LfFragmentTest, WaitsForTheFrameOfAFile) {
  start(4);
  push_frames(10, 0);
  std::thread cameras([this] {
    g_usleep(50000);
    push_frames(90, kFrame);
  });
  ASSERT_EQ(request(array_.request(0, kFrame)), GST_FLOW_OK);
  cameras.join();
  EXPECT_EQ(pull().actual_time, kFrame);
}

TEST_F(LfFragmentTest, WaitsForCamerasThatHaveNotBegun) {
  start(3);
  const HarnessPtr late(gst_harness_new_with_element(element_.get(), "sink_3", nullptr));
  gst_harness_set_live(late.get(), FALSE);
  push_frames(60, 0);
  std::thread camera([&late] {
    g_usleep(50000);
    gst_harness_set_src_caps_str(late.get(), ArrayFixture::caps("RGB").c_str());
    gst_harness_push(late.get(), ArrayFixture::frame("RGB", 60, 0));
  });
  ASSERT_EQ(request(array_.request(0, 0)), GST_FLOW_OK);
  camera.join();
  EXPECT_EQ(pull().fragments.size(), 4u);
}

TEST_F(LfFragmentTest, FilesAreReadNoFasterThanRequestsMoveOn) {
  start(1);
  std::atomic<int> pushed{0};
  std::thread camera([this, &pushed] {
    for (int i = 0; i < 6; i++, pushed++)
      ASSERT_EQ(gst_harness_push(cameras_[0].get(), ArrayFixture::frame("RGB", 9, static_cast<uint64_t>(i) * kFrame)),
                GST_FLOW_OK);
  });
  g_usleep(100000);
  EXPECT_LE(pushed, 2);
  ASSERT_EQ(request(array_.request(0, 5 * kFrame)), GST_FLOW_OK);
  camera.join();
  EXPECT_EQ(pull().actual_time, 5 * kFrame);
}

TEST_F(LfFragmentTest, TheLastFrameOfAFileStands) {
  start(4);
  push_frames(10, 0);
  for (const HarnessPtr& camera : cameras_) gst_harness_push_event(camera.get(), gst_event_new_eos());
  ASSERT_EQ(request(array_.request(0, 50 * kFrame)), GST_FLOW_OK);
  const wire::Answer answer = pull();
  EXPECT_EQ(answer.fragments.size(), 4u);
  EXPECT_EQ(answer.actual_time, 0u);
}

TEST_F(LfFragmentTest, LiveCamerasAreNeverWaitedFor) {
  start(4, "RGB", true);
  set("max-skew", "0");
  for (int i = 0; i < 20; i++) push_frames(static_cast<uint8_t>(i), static_cast<uint64_t>(i) * kFrame);
  ASSERT_EQ(request(array_.request(0, 100 * kFrame)), GST_FLOW_OK);
  EXPECT_EQ(pull().actual_time, 19 * kFrame);
  ASSERT_EQ(request(array_.request(1, 18 * kFrame)), GST_FLOW_OK);  // the latest few are kept
  EXPECT_EQ(pull().actual_time, 18 * kFrame);
}

TEST_F(LfFragmentTest, I420StaysI420) {
  start(4, "I420");
  push_frames(120, 0, "I420");
  ASSERT_EQ(request(array_.request(0, 0)), GST_FLOW_OK);
  const wire::Answer answer = pull();
  EXPECT_EQ(answer.family, PixelFamily::kI420);
  EXPECT_EQ(answer.fragments.size(), 4u);
}

TEST_F(LfFragmentTest, LimitedRangeIsConverted) {
  start(0);
  cameras_.emplace_back(gst_harness_new_with_element(element_.get(), "sink_0", nullptr));
  gst_harness_set_src_caps_str(cameras_[0].get(),
                               "video/x-raw,format=I420,width=32,height=24,framerate=10/1,colorimetry=bt601");
  gst_harness_push(cameras_[0].get(), ArrayFixture::frame("I420", 235, 0));  // white of the limited range
  const ViewRequest asked = array_.request(0, 0);
  ASSERT_EQ(request(asked), GST_FLOW_OK);
  const wire::Answer answer = pull();
  ASSERT_EQ(answer.fragments.size(), 1u);
  // Where camera 0 has its largest weight its luma is that weight of 255, not of 235.
  Rig rig = array_.rig();
  const RenderJob job(rig, build_mesh(rig), asked.view, std::vector<CameraIndex>{0});
  const Rect rect = answer.fragments[0].rect;
  const std::vector<float> hat = camera_hat(job.plan(), job.owners(), 0, rect);
  const size_t peak = static_cast<size_t>(std::max_element(hat.begin(), hat.end()) - hat.begin());
  EXPECT_NEAR(answer.fragments[0].pixels[peak], 255 * hat[peak], 1.5);
}

// Frames that came before all cameras were known are converted as if they had come later.
TEST_F(LfFragmentTest, AnswersDoNotDependOnWhichCameraComesFirst) {
  const std::string i420 = ArrayFixture::caps("I420"), rgb = ArrayFixture::caps("RGB");
  const std::string limited = "video/x-raw,format=I420,width=32,height=24,framerate=10/1,colorimetry=bt601";
  const struct {
    std::vector<std::string> caps;
    PixelFamily family;
  } cases[] = {{{i420, rgb, limited, rgb}, PixelFamily::kRgb}, {{i420, limited, i420, limited}, PixelFamily::kI420}};
  for (const auto& test : cases) {
    std::vector<std::vector<uint8_t>> answers;
    for (const std::vector<size_t>& order : {std::vector<size_t>{0, 1, 2, 3}, {3, 2, 1, 0}, {1, 2, 0, 3}}) {
      cameras_.clear();
      harness_.reset();
      start(4, nullptr);
      for (const size_t i : order) {
        gst_harness_set_src_caps_str(cameras_[i].get(), test.caps[i].c_str());
        std::mt19937 random(static_cast<unsigned>(i));
        std::vector<uint8_t> pixels(32 * 24 * (test.caps[i] == rgb ? 6 : 3) / 2);
        std::ranges::generate(pixels, [&random] { return static_cast<uint8_t>(random() % 256); });
        GstBuffer* frame = to_buffer(pixels);
        GST_BUFFER_PTS(frame) = 0;
        ASSERT_EQ(gst_harness_push(cameras_[i].get(), frame), GST_FLOW_OK);
      }
      ASSERT_EQ(request(array_.request(0, 0)), GST_FLOW_OK);
      const BufferPtr answer(gst_harness_try_pull(harness_.get()));
      ASSERT_TRUE(answer);
      answers.push_back(to_bytes(answer.get()));
      const auto decoded = wire::decode_answer(answers.back());
      ASSERT_TRUE(decoded);
      EXPECT_EQ(decoded->family, test.family);
      EXPECT_EQ(decoded->fragments.size(), 4u);
    }
    EXPECT_THAT(answers, testing::Each(answers[0]));
  }
}

// A grey JPEG of the cameras' size.
std::vector<uint8_t> grey_jpeg(uint8_t value) {
  Image image(PixelFamily::kRgb, ArrayFixture::kWidth, ArrayFixture::kHeight);
  std::fill(image.data().begin(), image.data().end(), value);
  const TempFile file({}, ".jpg");
  save_image(image, file.path());
  std::ifstream in(file.path(), std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}
GstBuffer* stamped(const std::vector<uint8_t>& bytes, uint64_t time) {
  GstBuffer* buffer = to_buffer(bytes);
  GST_BUFFER_PTS(buffer) = time;
  return buffer;
}

class LfFragmentJpegTest : public LfFragmentTest {
 protected:
  void start_jpeg(int cameras) {
    start(0);
    for (int i = 0; i < cameras; i++) {
      cameras_.emplace_back(
          gst_harness_new_with_element(element_.get(), ("sink_" + std::to_string(i)).c_str(), nullptr));
      gst_harness_set_live(cameras_.back().get(), FALSE);
      gst_harness_set_src_caps_str(cameras_.back().get(), "image/jpeg,framerate=10/1");
    }
  }
  void push_jpeg(const std::vector<uint8_t>& bytes, uint64_t time) {
    for (const HarnessPtr& camera : cameras_)
      ASSERT_EQ(gst_harness_push(camera.get(), stamped(bytes, time)), GST_FLOW_OK);
  }
  int grey_at(uint64_t time) {
    const ViewRequest asked = array_.request(static_cast<uint32_t>(time / kFrame), time);
    EXPECT_EQ(request(asked), GST_FLOW_OK);
    const wire::Answer answer = pull();
    EXPECT_EQ(answer.family, PixelFamily::kI420);
    Assembly assembly;
    assembly.begin(asked);
    add_answer(assembly, answer);
    return assembly.picture().resolve().plane(0)[8 * 6];
  }
};

TEST_F(LfFragmentJpegTest, FramesAreDecodedForTheView) {
  start_jpeg(4);
  push_jpeg(grey_jpeg(200), 0);
  EXPECT_NEAR(grey_at(0), 200, 2);
  push_jpeg(grey_jpeg(90), kFrame);
  EXPECT_NEAR(grey_at(kFrame), 90, 2);
  EXPECT_EQ(stat(element_.get(), "damaged-frames"), 0u);
}

TEST_F(LfFragmentJpegTest, TheFrameBeforeADamagedOneServes) {
  start_jpeg(4);
  push_jpeg(grey_jpeg(200), 0);
  EXPECT_NEAR(grey_at(0), 200, 2);
  push_jpeg({1, 2, 3}, kFrame);  // not even headers
  EXPECT_NEAR(grey_at(kFrame), 200, 2);
  EXPECT_EQ(stat(element_.get(), "damaged-frames"), 4u);
  std::vector<uint8_t> torn = grey_jpeg(50);
  torn[torn.size() - 12] = 0xff;  // a marker in the middle of the scan
  torn[torn.size() - 11] = 0xc4;
  push_jpeg(torn, 2 * kFrame);
  EXPECT_NEAR(grey_at(2 * kFrame), 200, 2);
  EXPECT_EQ(stat(element_.get(), "damaged-frames"), 8u);
  push_jpeg(grey_jpeg(120), 3 * kFrame);
  EXPECT_NEAR(grey_at(3 * kFrame), 120, 2);
  EXPECT_EQ(stat(element_.get(), "missing-frames"), 0u);
}

TEST_F(LfFragmentJpegTest, BesideRgbCamerasTheyBecomeRgb) {
  start(3);
  push_frames(200, 0);
  cameras_.emplace_back(gst_harness_new_with_element(element_.get(), "sink_3", nullptr));
  gst_harness_set_live(cameras_.back().get(), FALSE);
  gst_harness_set_src_caps_str(cameras_.back().get(), "image/jpeg,framerate=10/1");
  ASSERT_EQ(gst_harness_push(cameras_.back().get(), stamped(grey_jpeg(200), 0)), GST_FLOW_OK);
  const ViewRequest asked = array_.request(0, 0);
  ASSERT_EQ(request(asked), GST_FLOW_OK);
  const wire::Answer answer = pull();
  EXPECT_EQ(answer.family, PixelFamily::kRgb);
  EXPECT_EQ(answer.fragments.size(), 4u);
  const auto [low, high] = picture_range(asked, answer);
  EXPECT_GE(low, 197);
  EXPECT_LE(high, 203);
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
  const BufferPtr buffer(gst_harness_try_pull(second.get()));
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
  ASSERT_EQ(answer.fragments.size(), 1u);
  EXPECT_EQ(answer.fragments[0].camera, 3u);
}

TEST_F(LfFragmentTest, ShutsDownWhileARequestWaits) {
  start(4);
  std::thread requester([this] { request(array_.request(0, kFrame)); });
  g_usleep(30000);
  gst_element_set_state(element_.get(), GST_STATE_NULL);
  requester.join();
}

}  // namespace
}  // namespace lf::test
