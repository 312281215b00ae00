// SPDX-License-Identifier: LGPL-2.1-or-later
// Pixel families, YCbCr that is not ours, and JPEG frames.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <random>

#include "gst/fragment_fixture.h"
#include "image/image.h"
#include "support/add_answer.h"
#include "support/answer_codec.h"
#include "support/seeing.h"

namespace lf::test {
namespace {

TEST_F(LfFragmentTest, I420StaysI420) {
  start(4, "I420");
  push_frames(120, 0, "I420");
  ASSERT_EQ(request(array_.request(0, 0)), GST_FLOW_OK);
  const wire::Answer answer = pull();
  EXPECT_EQ(answer.family, PixelFamily::kI420);
  EXPECT_EQ(seeing(answer).size(), 4u);
}

// The same pictures in another layout give the same answers, to the bit.
TEST_F(LfFragmentTest, Nv12AndGreyAreTakenAsTheyAre) {
  constexpr size_t kLuma = 32 * 24, kChroma = 16 * 12;
  for (const char* colorimetry : {"1:4:0:0", "bt601", "bt709"}) {
    for (const bool grey : {false, true}) {
      std::vector<std::vector<uint8_t>> answers;
      for (const bool planar : {true, false}) {
        cameras_.clear();
        harness_.reset();
        start(4, nullptr);
        std::mt19937 random(7);
        for (const HarnessPtr& camera : cameras_) {
          std::vector<uint8_t> i420(kLuma + 2 * kChroma, 128);
          std::generate_n(i420.begin(), grey ? kLuma : i420.size(),
                          [&] { return static_cast<uint8_t>(random() % 256); });
          std::vector<uint8_t> other(i420.begin(), i420.begin() + kLuma);
          for (size_t k = 0; k < (grey ? 0 : kChroma); k++) {
            other.push_back(i420[kLuma + k]);
            other.push_back(i420[kLuma + kChroma + k]);
          }
          const bool system = std::string(colorimetry) == "1:4:0:0";
          const std::string caps = std::string("video/x-raw,width=32,height=24,framerate=10/1,format=") +
                                   (planar ? "I420"
                                    : grey ? "GRAY8"
                                           : "NV12") +
                                   (grey && !planar ? "" : std::string(",colorimetry=") + colorimetry) +
                                   (system && !grey ? ",chroma-site=jpeg" : "");
          if (grey && !system) continue;  // grey has no matrix
          gst_harness_set_src_caps_str(camera.get(), caps.c_str());
          GstBuffer* frame = to_buffer(planar ? i420 : other);
          GST_BUFFER_PTS(frame) = 0;
          ASSERT_EQ(gst_harness_push(camera.get(), frame), GST_FLOW_OK) << caps;
        }
        if (grey && std::string(colorimetry) != "1:4:0:0") break;
        ASSERT_EQ(request(array_.request(0, 0)), GST_FLOW_OK);
        const BufferPtr answer(gst_harness_pull(harness_.get()));
        ASSERT_TRUE(answer);
        answers.push_back(to_bytes(answer.get()));
      }
      if (answers.empty()) continue;
      const auto decoded = wire::decode_answer(answers[0]);
      ASSERT_TRUE(decoded);
      EXPECT_EQ(decoded->family, PixelFamily::kI420);
      EXPECT_EQ(seeing(*decoded).size(), 4u);
      EXPECT_TRUE(answers[0] == answers[1]) << colorimetry << " grey: " << grey;
    }
  }
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
  const std::vector<float> own = pixel_weights(job.plan(), job.owners(), 0, rect);
  const size_t peak = static_cast<size_t>(std::max_element(own.begin(), own.end()) - own.begin());
  EXPECT_NEAR(answer.fragments[0].pixels[peak], 255 * own[peak], 1.5);
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
      const BufferPtr answer(gst_harness_pull(harness_.get()));
      ASSERT_TRUE(answer);
      answers.push_back(to_bytes(answer.get()));
      const auto decoded = wire::decode_answer(answers.back());
      ASSERT_TRUE(decoded);
      EXPECT_EQ(decoded->family, test.family);
      EXPECT_EQ(seeing(*decoded).size(), 4u);
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
  EXPECT_EQ(seeing(answer).size(), 4u);
  const auto [low, high] = picture_range(asked, answer);
  EXPECT_GE(low, 197);
  EXPECT_LE(high, 203);
}

}  // namespace
}  // namespace lf::test
