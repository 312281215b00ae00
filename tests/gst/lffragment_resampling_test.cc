// SPDX-License-Identifier: LGPL-2.1-or-later
// How cameras' images are sampled, and what renders, from the property's nick to the picture.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <numeric>
#include <random>

#include "composite/accumulator.h"
#include "gst/fragment_fixture.h"
#include "image/correction.h"
#include "render/ownership.h"
#include "render/sum_renderer.h"
#include "support/add_answer.h"

namespace lf::test {
namespace {

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
    for (size_t i = 0; i < cameras_.size(); i++) {
      GstBuffer* frame = to_buffer(images_[i].data());
      GST_BUFFER_PTS(frame) = 0;
      GST_BUFFER_DURATION(frame) = kFrame;
      ASSERT_EQ(gst_harness_push(cameras_[i].get(), frame), GST_FLOW_OK);
    }
  }

  // What the library makes of these images.
  Image rendered(const ViewRequest& asked, Resampling resampling) const {
    const Rect whole{0, 0, ArrayFixture::kWidth, ArrayFixture::kHeight};
    std::vector<CameraIndex> all(4);
    std::iota(all.begin(), all.end(), 0);
    const RenderJob job(array_.rig(), build_mesh(array_.rig()), asked.view, all);
    std::vector<ByteBuffer> memory(4);
    std::vector<Source> sources;
    for (const CameraIndex i : job.cameras()) {
      const ImageView image = images_[i].view();
      sources.push_back({i, &array_.rig().cameras[i],
                         resampling == Resampling::kSharpened ? sharpen(image, whole, memory[i]) : image});
    }
    const SumRenderer renderer(job.plan(), job.runs(), sources, PixelFamily::kRgb);
    const Rect rect = renderer.rect();
    const size_t area = static_cast<size_t>(rect.width()) * rect.height();
    std::vector<int16_t> samples(3 * area);
    std::vector<uint16_t> lost(area);
    const bool any_lost =
        renderer.render_rows(rect.y0, rect.y1, packed_sums(PixelFamily::kRgb, rect, samples.data(), lost.data()));
    Accumulator sum;
    sum.reset(PixelFamily::kRgb, asked.view.width, asked.view.height);
    sum.add(packed_sums<const int16_t, const uint16_t>(PixelFamily::kRgb, rect, samples.data(),
                                                       any_lost ? lost.data() : nullptr));
    return sum.resolve();
  }

  std::vector<Image> images_;
};

TEST_F(LfFragmentResamplingTest, ThePictureIsTheLibrarysWhateverIsChosen) {
  start_with_images();
  const ViewRequest asked = array_.request(0, 0);
  const std::map<std::string, Resampling> choices{{"bilinear", Resampling::kBilinear},
                                                  {"sharpened", Resampling::kSharpened}};
  std::vector<std::vector<uint8_t>> pictures;
  for (const auto& [nick, resampling] : choices) {
    set("resampling", nick.c_str());
    ASSERT_EQ(request(asked), GST_FLOW_OK);
    const wire::Answer answer = pull();
    Assembly assembly;
    assembly.begin(asked);
    EXPECT_EQ(add_answer(assembly, answer), Assembly::Verdict::kAdded);
    const std::vector<uint8_t> picture = assembly.picture().resolve().data();
    EXPECT_EQ(picture, rendered(asked, resampling).data()) << nick;
    EXPECT_THAT(pictures, testing::Not(testing::Contains(picture))) << nick;
    pictures.push_back(picture);
  }
}

// What is coarser than the images is sampled as they are.
TEST_F(LfFragmentResamplingTest, CoarseViewsAreNotSharpened) {
  start_with_images();
  ViewRequest asked = array_.request(0, 0);
  for (const double scale : {1.0, 0.5}) {
    const Lens& lens = array_.rig().cameras[0].lens;
    asked.view.lens = Lens::pinhole(scale * lens.fy(), (asked.view.width - 1) / 2.0, (asked.view.height - 1) / 2.0);
    ASSERT_EQ(request(asked), GST_FLOW_OK);
    Assembly assembly;
    assembly.begin(asked);
    EXPECT_EQ(add_answer(assembly, pull()), Assembly::Verdict::kAdded);
    const Resampling expected = scale < 0.75 ? Resampling::kBilinear : Resampling::kSharpened;
    EXPECT_EQ(assembly.picture().resolve().data(), rendered(asked, expected).data()) << scale;
    asked.sequence++;
  }
}

// Switched while requests come: nothing is lost on the way.
TEST_F(LfFragmentResamplingTest, TheRendererChangesNoPixelByMoreThanOneLevel) {
  start_with_images();
  ViewRequest asked = array_.request(0, 0);
  const auto says = [this] {
    GstStructure* stats = nullptr;
    g_object_get(element_.get(), "stats", &stats, nullptr);
    const std::string renderer = gst_structure_get_string(stats, "renderer");
    gst_structure_free(stats);
    return renderer;
  };
  for (const char* renderer : {"gl", "cpu", "gl", "auto"}) {
    set("renderer", renderer);
    const uint64_t drawn = stat(element_.get(), "drawn");
    ASSERT_EQ(request(asked), GST_FLOW_OK);
    Assembly assembly;
    assembly.begin(asked);
    EXPECT_EQ(add_answer(assembly, pull()), Assembly::Verdict::kAdded);
    if (std::string(renderer) != "auto") {  // which depends on the machine
      EXPECT_EQ(stat(element_.get(), "drawn"), drawn + (std::string(renderer) == "gl" ? 1 : 0));
    }
    EXPECT_THAT(says(), testing::StartsWith(renderer));
    const std::vector<uint8_t> picture = assembly.picture().resolve().data();
    const std::vector<uint8_t> expected = rendered(asked, Resampling::kSharpened).data();
    ASSERT_EQ(picture.size(), expected.size());
    for (size_t i = 0; i < picture.size(); i++) ASSERT_LE(std::abs(picture[i] - expected[i]), 1) << i;
    asked.sequence++;
  }
}

TEST_F(LfFragmentResamplingTest, ANodeHandsItOn) {
  const ElementPtr node(GST_ELEMENT(gst_object_ref_sink(gst_element_factory_make("lfcameranode", nullptr))));
  gst_util_set_object_arg(G_OBJECT(node.get()), "resampling", "bilinear");
  const ElementPtr fragment(gst_bin_get_by_name(GST_BIN(node.get()), "fragment"));
  ASSERT_TRUE(fragment);
  for (GstElement* element : {node.get(), fragment.get()}) {
    gint value = 0;
    g_object_get(element, "resampling", &value, nullptr);
    EXPECT_EQ(value, static_cast<gint>(Resampling::kBilinear));
  }
}

}  // namespace
}  // namespace lf::test
