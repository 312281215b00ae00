// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "gst/compositor_fixture.h"
#include "wire/answer_parser.h"

namespace lf::test {
namespace {

using testing::HasSubstr;

class LfCompositorTreeTest : public LfCompositorTest {
 protected:
  // What a rack's compositor makes of these nodes' answers.
  std::vector<uint8_t> rack(const ViewRequest& asked, const std::vector<wire::Answer>& answers,
                            const std::string& codec = "raw16", guint node = 0) {
    start(static_cast<int>(answers.size()),
          {{"partial", "true"}, {"rig", array_.rig_path()}, {"codec", codec}, {"node", std::to_string(node)}});
    request(asked);
    for (size_t i = 0; i < answers.size(); i++) push(static_cast<int>(i), answers[i]);
    std::vector<uint8_t> out = pull();
    nodes_.clear();
    harness_.reset();
    return out;
  }

  std::vector<uint8_t> root(const ViewRequest& asked, const std::vector<std::vector<uint8_t>>& answers) {
    start(static_cast<int>(answers.size()), {{"rig", array_.rig_path()}});
    request(asked);
    for (size_t i = 0; i < answers.size(); i++)
      EXPECT_EQ(gst_harness_push(nodes_[i].get(), to_buffer(std::vector<uint8_t>(answers[i]))), GST_FLOW_OK);
    std::vector<uint8_t> picture = pull();
    missing_ = stat(element_.get(), "missing-fragments");
    nodes_.clear();
    harness_.reset();
    return picture;
  }

  guint64 missing_ = 0;
};

TEST_F(LfCompositorTreeTest, ThePictureIsThatOfOneCompositor) {
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420}) {
    const ViewRequest asked = array_.request(5, kFrame);
    std::vector<std::vector<uint8_t>> single;
    std::vector<wire::Answer> answers;
    for (CameraIndex camera = 0; camera < 4; camera++) {
      answers.push_back(answer_of(asked, {camera}, static_cast<uint8_t>(60 + 40 * camera), family));
      single.push_back(wire::encode_answer(answers.back()));
    }
    const std::vector<uint8_t> expected = root(asked, single);
    for (const char* codec : {"raw16", "raw"}) {
      const std::vector<uint8_t> picture = root(
          asked, {rack(asked, {answers[0], answers[1]}, codec, 1), rack(asked, {answers[2], answers[3]}, codec, 2)});
      EXPECT_EQ(missing_, 0u);
      ASSERT_EQ(picture.size(), expected.size());
      // 8 bits a value round each rack's sum once more.
      for (size_t i = 0; i < picture.size(); i++)
        ASSERT_NEAR(picture[i], expected[i], std::string(codec) == "raw16" ? 0 : 1) << codec << " " << i;
    }
  }
}

TEST_F(LfCompositorTreeTest, APartialAnswerSpeaksForTheRacksCameras) {
  const ViewRequest asked = array_.request(5, kFrame);
  wire::Answer first = answer_of(asked, {0}), second = answer_of(asked, {});
  first.actual_time -= 3000;
  second.cameras = second.blind = CameraRanges(CameraSet{2});
  second.family = PixelFamily::kNone;
  const std::vector<uint8_t> bytes = rack(asked, {first, second}, "raw16", 9);
  const wire::AnswerView view = wire::parse_answer(bytes).value();
  EXPECT_EQ(view.node, 9u);
  EXPECT_EQ(view.sequence, 5u);
  EXPECT_EQ(view.rig_hash, array_.rig().hash());
  EXPECT_EQ(view.actual_time, kFrame - 3000);
  EXPECT_EQ(view.cameras, CameraRanges(CameraSet{0, 2}));
  EXPECT_EQ(view.blind, CameraRanges(CameraSet{2}));
}

TEST_F(LfCompositorTreeTest, WhatIsMissingInARackIsMissingAtTheRoot) {
  const ViewRequest asked = array_.request(5, kFrame);
  wire::Answer blind = answer_of(asked, {});
  blind.cameras = blind.blind = CameraRanges(CameraSet{1});
  const std::vector<uint8_t> picture =
      root(asked, {rack(asked, {answer_of(asked, {0}), blind}), wire::encode_answer(answer_of(asked, {2, 3}))});
  EXPECT_NEAR(picture[(6 * 16 + 8) * 3], 200, 6);
}

TEST_F(LfCompositorTreeTest, NeedsTheRig) {
  const ElementPtr pipeline = launch("lfcompositor partial=true ! fakesink");
  EXPECT_THAT(run(pipeline.get(), 5), HasSubstr("set the property \"rig\""));
}

TEST(LfCompositorSettings, WhatHasNoEffectIsSaid) {
  const ArrayFixture array;
  const std::string rig = "rig=" + array.rig_path();
  struct Case {
    std::string properties, words;
  };
  for (const Case& c :
       {Case{"", ""}, Case{rig + " monitor-interval=8 gains=on focus-near=1 focus-far=2", ""},
        Case{rig + " partial=true node=7 codec=jpeg", ""}, Case{rig + " node=7", "node and codec: "},
        Case{rig + " codec=jpeg", "node and codec: "}, Case{rig + " focus=plane focus-far=3", "on a plane no depth"},
        Case{rig + " partial=true focus=surface", "focus: inside a tree"},
        Case{"monitor-interval=8", "monitor-interval: without a rig"}, Case{"gains=on", "gains: "},
        Case{"show=coverage", "show: only"}, Case{rig + " show=coverage", ""},
        Case{rig + " gains=on focus=plane node=1 focus-near=2 focus-far=1", "nearer"}}) {
    const ElementPtr pipeline = launch("lfcompositor " + c.properties + " ! fakesink async=false");
    ASSERT_TRUE(pipeline);
    ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
    g_autoptr(GstBus) bus = gst_element_get_bus(pipeline.get());
    const std::string told = warnings_on(bus);
    EXPECT_THAT(told, HasSubstr(c.words)) << c.properties;
    EXPECT_EQ(told.empty(), c.words.empty()) << c.properties << ": " << told;
    gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  }
}

}  // namespace
}  // namespace lf::test
