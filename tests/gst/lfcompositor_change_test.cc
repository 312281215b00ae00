// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gmock/gmock.h>

#include <atomic>
#include <thread>

#include "composite/camera_health.h"
#include "gst/compositor_live_fixture.h"
#include "gst/other_rig.h"

// Nodes that come and go, and rigs that are replaced, while lfcompositor runs.
namespace lf::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class LfCompositorChangeTest : public LfCompositorLiveTest {
 protected:
  void leave(size_t node) { nodes_[node].reset(); }
  void join(size_t node, bool live) {
    nodes_[node].reset(gst_harness_new_with_element(element_.get(), ("sink_" + std::to_string(node)).c_str(), nullptr));
    gst_harness_set_live(nodes_[node].get(), live);
    gst_harness_set_src_caps_str(nodes_[node].get(), "application/x-lightfield-answer");
  }
  void set_rig(const std::string& path) { g_object_set(element_.get(), "rig", path.c_str(), nullptr); }
};

TEST_F(LfCompositorChangeTest, FilesAreNotWaitedForByANodeThatLeft) {
  start(2, {{"rig", array_.rig_path()}});
  ViewRequest asked = array_.request(0, 0);
  request(asked);
  push(0, answer_of(asked, {0, 1, 2}));
  leave(1);
  LfCompositorTest::pull();
  EXPECT_EQ(stat(element_.get(), "missing-fragments"), 1u);
  // Its first answer is to a later request.
  join(1, false);
  asked = array_.request(1, kFrame);
  const ViewRequest next = array_.request(2, 2 * kFrame);
  request(asked);
  push(0, answer_of(asked, {0, 1, 2}));
  push(1, answer_of(next, {3}));
  LfCompositorTest::pull();
  EXPECT_EQ(stat(element_.get(), "missing-fragments"), 2u);
  request(next);
  push(0, answer_of(next, {0, 1, 2}));
  EXPECT_GE(range(LfCompositorTest::pull()).first, 199);
  EXPECT_EQ(stat(element_.get(), "missing-fragments"), 2u);
}

TEST_F(LfCompositorChangeTest, WhatCameOfANodeBeforeItLeftIsShown) {
  start(2, {{"rig", array_.rig_path()}});
  const ViewRequest asked = array_.request(0, 0);
  request(asked);
  push(1, answer_of(asked, {2, 3}));
  push(0, answer_of(asked, {0, 1}));
  leave(1);
  EXPECT_GE(range(LfCompositorTest::pull()).first, 199);
}

TEST_F(LfCompositorChangeTest, LiveTheNeighboursOfANodeThatLeftCloseTheGapUntilItIsBack) {
  start_live(2, {{"rig", array_.rig_path()}, {"max-missed", "2"}});
  ViewRequest asked = ask();
  push(1, answer_of(asked, {2, 3}));
  push(0, answer_of(asked, {0, 1}));
  EXPECT_GE(range(pull()).first, 199);
  leave(1);
  for (int i = 0; i < 3; i++) {
    EXPECT_THAT(announced(), IsEmpty()) << i;
    asked = ask();
    push(0, answer_of(asked, {0, 1}));
    EXPECT_FALSE(pull().empty()) << "nobody is waited for";
  }
  EXPECT_THAT(announced(), ElementsAre(CameraSet{2, 3}));
  const uint64_t missing = stat(element_.get(), "missing-fragments");
  asked = ask({2, 3});
  push(0, answer_of(asked, {0, 1}));
  EXPECT_GE(range(pull()).first, 199);
  EXPECT_EQ(stat(element_.get(), "missing-fragments"), missing);
  join(1, true);
  for (unsigned i = 0; i < CameraHealth::kBackAfter; i++) {
    EXPECT_THAT(announced(), IsEmpty()) << i;
    asked = ask({2, 3});
    wire::Answer nothing = answer_of(asked, {});
    nothing.cameras = CameraRanges(CameraSet{2, 3});
    push(1, nothing);
    push(0, answer_of(asked, {0, 1}));
    EXPECT_FALSE(pull().empty());
  }
  EXPECT_THAT(announced(), ElementsAre(CameraSet{}));
  asked = ask();
  push(1, answer_of(asked, {2, 3}));
  push(0, answer_of(asked, {0, 1}));
  EXPECT_GE(range(pull()).first, 199);
  EXPECT_EQ(stat(element_.get(), "missing-fragments"), missing);
}

TEST_F(LfCompositorChangeTest, NodesComeAndGoWhilePicturesAreMade) {
  start(1, {{"rig", array_.rig_path()}});
  nodes_.resize(2);
  std::atomic<bool> done = false;
  std::thread other([&] {
    while (!done) {
      join(1, false);
      gst_harness_push(nodes_[1].get(), to_buffer({1, 2, 3}));
      leave(1);
    }
  });
  for (uint32_t i = 0; i < 100; i++) {
    const ViewRequest asked = array_.request(i, i * kFrame);
    request(asked);
    push(0, answer_of(asked, {0, 1, 2, 3}));
    EXPECT_GE(range(LfCompositorTest::pull()).first, 199);
  }
  done = true;
  other.join();
}

// ------------------------------------------------------------------------------------------------------------ rigs

// Pictures of the one rig are dark, of the other one bright; wherever one is wholly lost the picture before shows.
TEST_F(LfCompositorChangeTest, NoPictureMixesTwoRigsWhateverIsReplacedFirst) {
  const OtherRig other(array_.rig(), [](Rig& rig) { rig.cameras[0].lens = Lens::pinhole(31, 15.5, 11.5); });
  const std::vector<CameraIndex> own[] = {{0}, {1, 2, 3}};  // a triangle is the second one's alone
  std::vector<size_t> order{0, 1, 2, 3};                    // the viewer, the nodes, the compositor
  do {
    SCOPED_TRACE(testing::PrintToString(order));
    start_live(2, {{"rig", array_.rig_path()}});
    bool is_new[4] = {};
    const auto hash = [&](bool second) { return second ? other.hash() : array_.rig().hash(); };
    for (size_t step = 0; step < 6; step++) {
      if (step > 0 && step < 5) is_new[order[step - 1]] = true;
      if (step > 0 && step < 5 && order[step - 1] == 3) set_rig(other.path());
      ViewRequest asked = array_.request(sequence_, kNow + sequence_ * kFrame);
      sequence_++;
      asked.rig_hash = hash(is_new[0]);
      asked.view.lens = Lens::pinhole(15, 7.5, 5.5);  // far into both triangles
      gst_harness_set_time(harness_.get(), asked.target_time);
      request(asked);
      for (const size_t node : {0u, 1u}) {
        const bool second = is_new[1 + node];
        wire::Answer answer = answer_of(asked, own[node], second ? 220 : 50);
        answer.rig_hash = hash(second);
        if (second != is_new[0]) {  // the request is for another rig
          answer.fragments.clear();
          answer.cameras = {};
        }
        push(static_cast<int>(node), answer);
      }
      const std::vector<uint8_t> picture = pull();
      ASSERT_FALSE(picture.empty());
      bool dark = false, bright = false;
      for (const uint8_t value : picture) {
        dark = dark || (value > 10 && value < 60);
        bright = bright || value > 200;
        EXPECT_TRUE(value <= 10 || (value > 40 && value < 60) || value > 200) << int{value};
      }
      EXPECT_FALSE(dark && bright) << "step " << step;
      EXPECT_TRUE(step > 0 || range(picture).second <= 51);
      EXPECT_TRUE(step < 4 || range(picture).first >= 218);
    }
    EXPECT_EQ(stat(element_.get(), "complete"), 3u);
    nodes_.clear();
    harness_.reset();
    sequence_ = 0;
  } while (std::next_permutation(order.begin(), order.end()));
}

TEST_F(LfCompositorChangeTest, CamerasOutOfServiceAreForgottenWithTheirRig) {
  const OtherRig smaller(array_.rig(), [](Rig& rig) {
    rig.cameras.pop_back();
    rig.topology = {};
  });
  start_live(1, {{"rig", array_.rig_path()}, {"max-missed", "1"}});
  for (int i = 0; i < 2; i++) {
    push(0, answer_of(ask(), {0, 1}));
    pull();
  }
  EXPECT_THAT(announced(), ElementsAre(CameraSet{2, 3}));
  set_rig(smaller.path());
  ask({3});  // which now is nobody: dropped
  settle(30);
  EXPECT_THAT(announced(), ElementsAre(CameraSet{}));
  EXPECT_EQ(stat(element_.get(), "out-of-service"), 0u);
  EXPECT_EQ(stat(element_.get(), "bad-requests"), 1u);
  ViewRequest asked = ask();
  wire::Answer answer = answer_of(asked, {0, 1, 2});
  answer.rig_hash = smaller.hash();
  push(0, answer);
  EXPECT_FALSE(pull().empty());
}

TEST_F(LfCompositorChangeTest, ARigThatCannotBeReadChangesNothing) {
  start(1, {{"rig", array_.rig_path()}});
  const std::unique_ptr<GstBus, Unref<gst_object_unref>> bus(gst_bus_new());
  gst_element_set_bus(element_.get(), bus.get());
  set_rig("/nowhere/rig.json");
  GstMessage* message = gst_bus_pop_filtered(bus.get(), GST_MESSAGE_WARNING);
  ASSERT_TRUE(message);
  g_autoptr(GError) error = nullptr;
  gst_message_parse_warning(message, &error, nullptr);
  EXPECT_THAT(error->message, HasSubstr("/nowhere/rig.json"));
  gst_message_unref(message);
  const ViewRequest asked = array_.request(0, 0);
  request(asked);
  push(0, answer_of(asked, {0, 1, 2}));
  LfCompositorTest::pull();
  EXPECT_EQ(stat(element_.get(), "missing-fragments"), 1u);
  g_autofree gchar* kept = nullptr;
  g_object_get(element_.get(), "rig", &kept, nullptr);
  EXPECT_EQ(kept, array_.rig_path());
}

}  // namespace
}  // namespace lf::test
