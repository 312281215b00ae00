// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/still.h"
#include "gst/fragment_fixture.h"

namespace lf::test {
namespace {

GstBuffer* stamped(const std::vector<uint8_t>& bytes, uint64_t time) {
  GstBuffer* buffer = to_buffer(bytes);
  GST_BUFFER_PTS(buffer) = time;
  return buffer;
}

TEST_F(LfFragmentTest, I420StaysI420) {
  start(4, "I420");
  push_frames(120, 0, "I420");
  const wire::Answer answer = answer_to(array_.request(0, 0));
  EXPECT_EQ(answer.family, PixelFamily::kI420);
  EXPECT_EQ(seeing(answer).size(), 4u);
}

TEST_F(LfFragmentTest, Nv12AndGreyNeedNoConversion) {
  constexpr size_t kLuma = 32 * 24, kChroma = 16 * 12;
  for (const char* colorimetry : {"1:4:0:0", "bt601", "bt709"}) {
    for (const bool grey : {false, true}) {
      std::vector<std::vector<uint8_t>> answers;
      for (const bool planar : {true, false}) {
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
          ASSERT_EQ(gst_harness_push(camera.get(), stamped(planar ? i420 : other, 0)), GST_FLOW_OK) << caps;
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
  gst_harness_push(cameras_[0].get(), ArrayFixture::frame("I420", 235, 0));  // white in limited range
  const ViewRequest asked = array_.request(0, 0);
  const wire::Answer answer = answer_to(asked);
  ASSERT_EQ(answer.fragments.size(), 1u);
  // At the largest weight of camera 0, its luma is that weight times 255, not 235.
  Rig rig = array_.rig();
  const RenderJob job(rig, build_mesh(rig), asked.view, std::vector<CameraIndex>{0});
  const Rect rect = answer.fragments[0].rect;
  const std::vector<float> own = pixel_weights(job.plan(), FaceIdMap(job.runs()), 0, rect);
  const size_t peak = static_cast<size_t>(std::max_element(own.begin(), own.end()) - own.begin());
  EXPECT_NEAR(answer.fragments[0].pixels[peak], 255 * own[peak], 1.5);
}

// Frames may arrive before all cameras have caps.
TEST_F(LfFragmentTest, AnswersDoNotDependOnTheOrderOfCameras) {
  const std::string i420 = ArrayFixture::caps("I420"), rgb = ArrayFixture::caps("RGB");
  const std::string limited = "video/x-raw,format=I420,width=32,height=24,framerate=10/1,colorimetry=bt601";
  const struct {
    std::vector<std::string> caps;
    PixelFamily family;
  } cases[] = {{{i420, rgb, limited, rgb}, PixelFamily::kRgb}, {{i420, limited, i420, limited}, PixelFamily::kI420}};
  for (const auto& test : cases) {
    std::vector<std::vector<uint8_t>> answers;
    for (const std::vector<size_t>& order : {std::vector<size_t>{0, 1, 2, 3}, {3, 2, 1, 0}, {1, 2, 0, 3}}) {
      start(4, nullptr);
      for (const size_t i : order) {
        gst_harness_set_src_caps_str(cameras_[i].get(), test.caps[i].c_str());
        std::mt19937 random(static_cast<unsigned>(i));
        std::vector<uint8_t> pixels(32 * 24 * (test.caps[i] == rgb ? 6 : 3) / 2);
        std::ranges::generate(pixels, [&random] { return static_cast<uint8_t>(random() % 256); });
        ASSERT_EQ(gst_harness_push(cameras_[i].get(), stamped(pixels, 0)), GST_FLOW_OK);
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
    EXPECT_THAT(answers, Each(answers[0]));
  }
}

std::vector<uint8_t> grey_jpeg(uint8_t value) {
  Image image(PixelFamily::kRgb, ArrayFixture::kWidth, ArrayFixture::kHeight);
  std::fill(image.data().begin(), image.data().end(), value);
  const TempFile file("", ".jpg");
  save_image(image, file.path());
  return read_bytes(file.path());
}
class LfFragmentJpegTest : public LfFragmentTest {
 protected:
  void start_jpeg(int cameras) {
    start(cameras, nullptr);
    for (const HarnessPtr& camera : cameras_) gst_harness_set_src_caps_str(camera.get(), "image/jpeg,framerate=10/1");
  }
  void push_jpeg(const std::vector<uint8_t>& bytes, uint64_t time) {
    for (const HarnessPtr& camera : cameras_)
      ASSERT_EQ(gst_harness_push(camera.get(), stamped(bytes, time)), GST_FLOW_OK);
  }
  int grey_at(uint64_t time) {
    const ViewRequest asked = array_.request(static_cast<uint32_t>(time / kFrame), time);
    const wire::Answer answer = answer_to(asked);
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

TEST_F(LfFragmentJpegTest, PreviousFrameReplacesADamagedOne) {
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

TEST_F(LfFragmentJpegTest, JpegIsConvertedIfOtherCamerasAreRgb) {
  start_showing(200, 3);
  cameras_.emplace_back(gst_harness_new_with_element(element_.get(), "sink_3", nullptr));
  gst_harness_set_live(cameras_.back().get(), FALSE);
  gst_harness_set_src_caps_str(cameras_.back().get(), "image/jpeg,framerate=10/1");
  ASSERT_EQ(gst_harness_push(cameras_.back().get(), stamped(grey_jpeg(200), 0)), GST_FLOW_OK);
  const ViewRequest asked = array_.request(0, 0);
  const wire::Answer answer = answer_to(asked);
  EXPECT_EQ(answer.family, PixelFamily::kRgb);
  EXPECT_EQ(seeing(answer).size(), 4u);
  const auto [low, high] = picture_range(asked, answer);
  EXPECT_GE(low, 197);
  EXPECT_LE(high, 203);
}

// --- Sampling and renderers ------------------------------------------------------------------------------------------
// Resampling of camera images, and renderers, from the property's nick to the picture.

class LfFragmentResamplingTest : public LfFragmentTest {
 protected:
  LfFragmentResamplingTest() {
    std::mt19937 random(1);
    for (int i = 0; i < 4; i++) {
      images_.emplace_back(PixelFamily::kRgb, ArrayFixture::kWidth, ArrayFixture::kHeight);
      for (uint8_t& v : images_.back().data()) v = static_cast<uint8_t>(random());
    }
  }

  void start_with_images() {
    start(4);
    set("codec", "raw16");
    for (size_t i = 0; i < cameras_.size(); i++)
      ASSERT_EQ(gst_harness_push(cameras_[i].get(), stamped(images_[i].data(), 0)), GST_FLOW_OK);
  }

  // Returns the picture of the element's answer.
  Image picture_of(const ViewRequest& asked) {
    Assembly assembly;
    assembly.begin(asked);
    EXPECT_EQ(add_answer(assembly, answer_to(asked)), Assembly::Verdict::kAdded);
    return assembly.picture().resolve();
  }

  // Returns the picture that the library renders.
  Image rendered(const ViewRequest& asked, Resampling resampling) const {
    return render_still(
               array_.rig(), build_mesh(array_.rig()), asked.view,
               [this](CameraIndex i) -> const Image& { return images_[i]; }, resampling)
        .picture;
  }

  std::vector<Image> images_;
};

TEST_F(LfFragmentResamplingTest, PicturesEqualTheLibrarysForEveryChoice) {
  start_with_images();
  const ViewRequest asked = array_.request(0, 0);
  const std::map<std::string, Resampling> choices{{"bilinear", Resampling::kBilinear},
                                                  {"sharpened", Resampling::kSharpened}};
  std::vector<std::vector<uint8_t>> pictures;
  for (const auto& [nick, resampling] : choices) {
    set("resampling", nick.c_str());
    const std::vector<uint8_t> picture = picture_of(asked).data();
    EXPECT_EQ(picture, rendered(asked, resampling).data()) << nick;
    EXPECT_THAT(pictures, Not(Contains(picture))) << nick;
    pictures.push_back(picture);
  }
}

TEST_F(LfFragmentResamplingTest, CoarseViewsAreNotSharpened) {
  start_with_images();
  ViewRequest asked = array_.request(0, 0);
  for (const double scale : {1.0, 0.5}) {
    const Lens& lens = array_.rig().cameras[0].lens;
    asked.view.lens = Lens::pinhole(scale * lens.fy(), (asked.view.width - 1) / 2.0, (asked.view.height - 1) / 2.0);
    const Image drawn_picture = picture_of(asked);
    const Resampling expected = scale < 0.75 ? Resampling::kBilinear : Resampling::kSharpened;
    EXPECT_EQ(drawn_picture.data(), rendered(asked, expected).data()) << scale;
    asked.sequence++;
  }
}

TEST_F(LfFragmentResamplingTest, RenderersDifferByAtMostOneLevel) {
  start_with_images();
  ViewRequest asked = array_.request(0, 0);
  const auto says = [this]() -> std::string {
    return gst_structure_get_string(stats_of(element_.get()).get(), "renderer");
  };
  for (const char* renderer : {"gl", "cpu", "gl", "auto"}) {
    set("renderer", renderer);
    const uint64_t drawn = stat(element_.get(), "drawn");
    const Image drawn_picture = picture_of(asked);
    if (std::string(renderer) != "auto") {  // "auto" depends on the machine
      EXPECT_EQ(stat(element_.get(), "drawn"), drawn + (std::string(renderer) == "gl" ? 1 : 0));
    }
    EXPECT_THAT(says(), StartsWith(renderer));
    const std::vector<uint8_t>& picture = drawn_picture.data();
    const std::vector<uint8_t> expected = rendered(asked, Resampling::kSharpened).data();
    ASSERT_EQ(picture.size(), expected.size());
    for (size_t i = 0; i < picture.size(); i++) ASSERT_LE(std::abs(picture[i] - expected[i]), 1) << i;
    asked.sequence++;
  }
}

TEST_F(LfFragmentResamplingTest, NodeForwardsTheProperty) {
  const ElementPtr node = make_element("lfcameranode");
  gst_util_set_object_arg(G_OBJECT(node.get()), "resampling", "bilinear");
  const ElementPtr fragment = child_of(node.get(), "fragment");
  ASSERT_TRUE(fragment);
  for (GstElement* element : {node.get(), fragment.get()})
    EXPECT_EQ(get<gint>(element, "resampling"), static_cast<gint>(Resampling::kBilinear));
}

}  // namespace
}  // namespace lf::test
