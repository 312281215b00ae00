// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gst/check/gsttestclock.h>

#include "common/custom_events.h"
#include "composite/camera_health.h"
#include "composite/latency_control.h"
#include "gst/compositor_fixture.h"
#include "support/fragments.h"

namespace lf::test {
namespace {

constexpr uint64_t kNow = 1000 * GST_SECOND, kLatency = 40 * GST_MSECOND;

// Live, with a clock that only tests advance: output without an advance did not wait for the deadline.
class LfCompositorLiveTest : public LfCompositorTest {
 protected:
  void start_live(int nodes, const std::vector<std::pair<std::string, std::string>>& properties = {}) {
    live_ = TRUE;
    sequence_ = 0;
    start(nodes, properties);
    g_object_set(element_.get(), "latency", kLatency, nullptr);
    gst_harness_use_testclock(harness_.get());
    gst_harness_set_time(harness_.get(), kNow);
    gst_harness_query_latency(harness_.get());
  }

  ViewRequest ask(const CameraSet& out_of_service = {}) {
    ViewRequest asked = array_.request(sequence_, kNow + sequence_ * kFrame);
    sequence_++;
    asked.out_of_service = out_of_service;
    gst_harness_set_time(harness_.get(), asked.target_time);
    request(asked);
    return asked;
  }

  // Two nodes answer with the whole array, the second first.
  void push_both(const ViewRequest& asked) {
    push(1, answer_of(asked, {2, 3}));
    push(0, answer_of(asked, {0, 1}));
  }

  // Advances the clock past the deadline of the latest request.
  void pass_deadline() { gst_harness_set_time(harness_.get(), kNow + (sequence_ - 1) * kFrame + kLatency); }

  std::vector<uint8_t> pull() {
    settle(5000);
    return gst_harness_buffers_in_queue(harness_.get()) > 0 ? LfCompositorTest::pull() : std::vector<uint8_t>{};
  }

  // Gives the compositor this many milliseconds, or until a picture is out. GstTestClock releases no wait on its own,
  // not even one in the past.
  void settle(int milliseconds) {
    GstTestClock* clock = gst_harness_get_testclock(harness_.get());
    for (int i = 0; i < milliseconds && gst_harness_buffers_in_queue(harness_.get()) == 0; i++) {
      GstClockID id = nullptr;
      if (gst_test_clock_peek_next_pending_id(clock, &id)) {
        if (gst_clock_id_get_time(id) <= gst_clock_get_time(GST_CLOCK(clock)))
          gst_clock_id_unref(gst_test_clock_process_next_clock_id(clock));
        gst_clock_id_unref(id);
      }
      g_usleep(1000);
    }
    gst_object_unref(clock);
  }

  std::vector<CameraSet> announced() {
    std::vector<CameraSet> sets;
    while (const EventPtr event{gst_harness_try_pull_upstream_event(harness_.get())}) {
      const std::shared_ptr<const ViewFeedback> feedback = parse_view_feedback(event.get());
      if (feedback && feedback->out_of_service && feedback->view_id == 0) sets.push_back(*feedback->out_of_service);
    }
    return sets;
  }

  uint32_t sequence_ = 0;
};

// capture-delay grows and the application ignores the LATENCY message.
TEST_F(LfCompositorLiveTest, FollowsGrowingLatency) {
  constexpr uint64_t kDelay = 300 * GST_MSECOND;
  start_live(1, {{"rig", array_.rig_path()}});
  ViewRequest asked = ask();
  push(0, answer_of(asked, {0, 1, 2, 3}));
  EXPECT_FALSE(pull().empty());
  gst_harness_set_upstream_latency(harness_.get(), kDelay);
  asked = array_.request(sequence_, kNow + kFrame);
  gst_harness_set_time(harness_.get(), asked.target_time + kDelay);
  request(asked);
  settle(300);
  EXPECT_EQ(gst_harness_buffers_in_queue(harness_.get()), 0u) << "not late yet";
  push(0, answer_of(asked, {0, 1, 2, 3}));
  EXPECT_GE(range(pull()).first, 199);
}

TEST_F(LfCompositorLiveTest, PictureIsOutputAtTheDeadlineWithoutASilentNode) {
  start_live(2, {{"rig", array_.rig_path()}});
  push(0, answer_of(ask(), {0, 1, 2}));
  pass_deadline();
  pull();
  EXPECT_EQ(stat(element_.get(), "missing-fragments"), 1u);
  EXPECT_THAT(announced(), IsEmpty());
}

TEST_F(LfCompositorLiveTest, StoppedNodeIsSkippedAndReturns) {
  start_live(2, {{"rig", array_.rig_path()}, {"max-missed", "2"}});
  ViewRequest asked = ask();
  push(1, answer_of(asked, {0, 1}));
  push(0, answer_of(asked, {2, 3}));
  EXPECT_GE(range(pull()).first, 199);
  for (int i = 0; i < 3; i++) {
    EXPECT_THAT(announced(), IsEmpty()) << i;
    asked = ask();
    push(1, answer_of(asked, {0, 1}));
    pass_deadline();
    pull();
  }
  EXPECT_THAT(announced(), ElementsAre(CameraSet{2, 3}));
  EXPECT_EQ(stat(element_.get(), "out-of-service"), 2u);

  // The compositor no longer waits for the stopped node, and the picture has no hole.
  for (int i = 0; i < 3; i++) {
    asked = ask({2, 3});
    if (i > 0) settle(30);
    push(1, answer_of(asked, {0, 1}));
    const std::vector<uint8_t> healed = pull();
    ASSERT_FALSE(healed.empty());
    EXPECT_GE(range(healed).first, 199);
    EXPECT_EQ(stat(element_.get(), "missing-fragments"), 6u);
  }

  // The node resumes: its first answer is too late for the picture but restores the node.
  wire::Answer nothing;
  for (unsigned i = 0; i < CameraHealth::kRecoveryPictures + 1 && stat(element_.get(), "out-of-service") > 0; i++) {
    asked = ask({2, 3});
    nothing = answer_of(asked, {});
    nothing.cameras = CameraRanges(CameraSet{2, 3});
    if (i > 0) push(0, nothing);
    push(1, answer_of(asked, {0, 1}));
    pull();
    if (i > 0) continue;
    push(0, nothing);
    settle(30);
  }
  EXPECT_THAT(announced(), ElementsAre(CameraSet{}));
  asked = ask();
  push(0, answer_of(asked, {2, 3}));
  push(1, answer_of(asked, {0, 1}));
  EXPECT_GE(range(pull()).first, 199);
  EXPECT_EQ(stat(element_.get(), "missing-fragments"), 6u);
}

// Answers that always arrive after the deadline. The picture must not stand still, and a node that is late alone must
// not delay the picture.
TEST_F(LfCompositorLiveTest, LatencyIncreasesIfAllAnswersAreLate) {
  for (const int nodes : {1, 2}) {
    start_live(nodes, {{"rig", array_.rig_path()}, {"max-missed", "2"}});
    const auto latency = [&] {
      guint64 value = 0;
      g_object_get(element_.get(), "latency", &value, nullptr);
      return value;
    };
    for (int i = 0; i < 30 && latency() == kLatency; i++) {
      const ViewRequest asked = ask();
      if (nodes == 2) push(1, answer_of(asked, {2, 3}));
      gst_harness_set_time(harness_.get(), asked.target_time + 2 * kLatency);
      pull();
      push(0, answer_of(asked, {0, 1}));
    }
    EXPECT_EQ(latency() > kLatency, nodes == 1);
    EXPECT_LE(latency(), lf::LatencyControl::kMost * kLatency);
    gst_element_set_state(element_.get(), GST_STATE_READY);
    EXPECT_EQ(latency(), kLatency) << "the next start begins with the value of the application";
  }
}

TEST_F(LfCompositorLiveTest, BlindCameraIsTakenOutOfService) {
  start_live(1, {{"max-missed", "1"}});
  for (int i = 0; i < 3; i++) {
    wire::Answer answer = answer_of(ask(), i == 0 ? CameraSet{0, 1, 2, 3} : CameraSet{0, 1, 2});
    answer.cameras = CameraRanges(CameraSet{0, 1, 2, 3});
    if (i > 0) answer.blind = CameraRanges(CameraSet{3});
    push(0, answer);
    pull();
  }
  EXPECT_THAT(announced(), ElementsAre(CameraSet{3}));
}

TEST_F(LfCompositorLiveTest, PreviousPictureRepeatsWithoutAnswers) {
  start_live(1, {{"rig", array_.rig_path()}, {"max-missed", "0"}});
  ViewRequest asked = ask();
  push(0, answer_of(asked, {0, 1, 2, 3}, 90));
  const std::vector<uint8_t> complete = pull();
  asked = ask();
  pass_deadline();
  EXPECT_EQ(pull(), complete);
  EXPECT_EQ(last_pts_, asked.target_time);
  EXPECT_EQ(stat(element_.get(), "incomplete"), 1u);
  EXPECT_EQ(stat(element_.get(), "missing-fragments"), 4u);
  asked = ask();
  push(0, answer_of(asked, {0, 1, 2, 3}, 250));
  EXPECT_GE(range(pull()).first, 248);
}

TEST_F(LfCompositorLiveTest, IncompletePicturesAreRepeatedOrDropped) {
  for (const std::string options : {"repeat", "drop"}) {
    SCOPED_TRACE(options);
    start_live(1, {{"rig", array_.rig_path()}, {"incomplete", options}});
    ViewRequest asked = ask();
    push(0, answer_of(asked, {0, 1, 2, 3}, 90));
    const std::vector<uint8_t> complete = pull();
    asked = ask();
    push(0, answer_of(asked, {0, 1, 2}, 250));
    if (options == "repeat") {
      EXPECT_EQ(pull(), complete);
      EXPECT_EQ(last_pts_, asked.target_time);
      EXPECT_EQ(stat(element_.get(), "repeated"), 1u);
    }
    asked = ask();
    push(0, answer_of(asked, {0, 1, 2, 3}, 250));
    EXPECT_GE(range(pull()).first, 248);
    EXPECT_EQ(last_pts_, asked.target_time);
    EXPECT_EQ(stat(element_.get(), "incomplete"), 1u);
    EXPECT_EQ(stat(element_.get(), "dropped"), options == "drop" ? 1u : 0u);
  }
}

std::vector<std::vector<uint8_t>> in_parts(const wire::Answer& answer) {
  std::vector<std::vector<uint8_t>> parts;
  const std::vector<Fragment> halves = halves_of(answer.fragments.at(0));
  for (uint32_t i = 0; i < 2; i++) {
    const Fragment& f = halves[i];
    wire::AnswerWriter writer(answer, 1);
    const std::span<uint8_t> to = writer.add({{}, f.family, f.rect, wire::Codec::kRaw, 0, !f.lost.empty()});
    std::ranges::copy(f.lost, std::ranges::copy(f.pixels, to.begin()).out);
    writer.set_part(i, 2);
    const ByteBuffer bytes = writer.finish();
    parts.emplace_back(bytes.begin(), bytes.end());
  }
  return parts;
}

TEST_F(LfCompositorLiveTest, PartsMayBeReorderedAndDuplicated) {
  start_live(2, {{"rig", array_.rig_path()}});
  for (const std::vector<size_t>& order : {std::vector<size_t>{0, 1}, {1, 0}, {1, 1, 0}}) {
    const ViewRequest asked = ask();
    push(0, answer_of(asked, {0}));
    const auto parts = in_parts(answer_of(asked, {1, 2, 3}));
    for (const size_t i : order) push(1, parts[i]);
    EXPECT_GE(range(pull()).first, 199);
  }
  EXPECT_EQ(stat(element_.get(), "repeated-answers"), 1u);
  EXPECT_EQ(stat(element_.get(), "bad-answers"), 0u);
  EXPECT_EQ(stat(element_.get(), "incomplete"), 0u);
}

TEST_F(LfCompositorLiveTest, LostPartIsConcealedAtTheDeadline) {
  start_live(2, {{"rig", array_.rig_path()}});
  const ViewRequest asked = ask();
  push(0, answer_of(asked, {0}));
  push(1, in_parts(answer_of(asked, {1, 2, 3}))[1]);
  pass_deadline();
  const std::vector<uint8_t> picture = pull();
  EXPECT_EQ(stat(element_.get(), "missing-fragments"), 3u);
  EXPECT_NEAR(picture[(4 * 16 + 6) * 3], 200, 6);
  EXPECT_NEAR(picture[(8 * 16 + 6) * 3], 200, 1);
}

// Changes of nodes and rigs while lfcompositor runs.
class LfCompositorChangeTest : public LfCompositorLiveTest {
 protected:
  void remove_node(size_t node) { nodes_[node].reset(); }
  void add_node(size_t node, bool live) {
    nodes_[node].reset(gst_harness_new_with_element(element_.get(), ("sink_" + std::to_string(node)).c_str(), nullptr));
    gst_harness_set_live(nodes_[node].get(), live);
    gst_harness_set_src_caps_str(nodes_[node].get(), "application/x-lightfield-answer");
  }
  void set_rig(const std::string& path) { g_object_set(element_.get(), "rig", path.c_str(), nullptr); }
};

TEST_F(LfCompositorChangeTest, DoesNotWaitForARemovedNode) {
  start(2, {{"rig", array_.rig_path()}});
  ViewRequest asked = ask_and_answer(0, 0, {0, 1, 2});
  remove_node(1);
  LfCompositorTest::pull();
  EXPECT_EQ(stat(element_.get(), "missing-fragments"), 1u);
  add_node(1, false);
  asked = array_.request(1, kFrame);
  const ViewRequest next = array_.request(2, 2 * kFrame);
  request_and_answer(asked, {0, 1, 2});
  push(1, answer_of(next, {3}));
  LfCompositorTest::pull();
  EXPECT_EQ(stat(element_.get(), "missing-fragments"), 2u);
  request_and_answer(next, {0, 1, 2});
  EXPECT_GE(range(LfCompositorTest::pull()).first, 199);
  EXPECT_EQ(stat(element_.get(), "missing-fragments"), 2u);
}

TEST_F(LfCompositorChangeTest, AnswersOfARemovedNodeAreShown) {
  start(2, {{"rig", array_.rig_path()}});
  const ViewRequest asked = array_.request(0, 0);
  request(asked);
  push_both(asked);
  remove_node(1);
  EXPECT_GE(range(LfCompositorTest::pull()).first, 199);
}

TEST_F(LfCompositorChangeTest, NeighboursFillInForARemovedLiveNode) {
  start_live(2, {{"rig", array_.rig_path()}, {"max-missed", "2"}});
  ViewRequest asked = ask();
  push_both(asked);
  EXPECT_GE(range(pull()).first, 199);
  remove_node(1);
  for (int i = 0; i < 3; i++) {
    EXPECT_THAT(announced(), IsEmpty()) << i;
    asked = ask();
    push(0, answer_of(asked, {0, 1}));
    EXPECT_FALSE(pull().empty()) << "waits for no node";
  }
  EXPECT_THAT(announced(), ElementsAre(CameraSet{2, 3}));
  const uint64_t missing = stat(element_.get(), "missing-fragments");
  asked = ask({2, 3});
  push(0, answer_of(asked, {0, 1}));
  EXPECT_GE(range(pull()).first, 199);
  EXPECT_EQ(stat(element_.get(), "missing-fragments"), missing);
  add_node(1, true);
  for (unsigned i = 0; i < CameraHealth::kRecoveryPictures; i++) {
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
  push_both(asked);
  EXPECT_GE(range(pull()).first, 199);
  EXPECT_EQ(stat(element_.get(), "missing-fragments"), missing);
}

TEST_F(LfCompositorChangeTest, NodesAreAddedAndRemovedWhilePlaying) {
  start(1, {{"rig", array_.rig_path()}});
  nodes_.resize(2);
  std::atomic<bool> done = false;
  std::thread other([&] {
    while (!done) {
      add_node(1, false);
      gst_harness_push(nodes_[1].get(), to_buffer({1, 2, 3}));
      remove_node(1);
    }
  });
  for (uint32_t i = 0; i < 100; i++) {
    ask_and_answer(i, i * kFrame, {0, 1, 2, 3});
    EXPECT_GE(range(LfCompositorTest::pull()).first, 199);
  }
  done = true;
  other.join();
}

// --- Rigs ------------------------------------------------------------------------------------------------------------

// Pictures of the two rigs differ in brightness. If all answers of a request are lost, the previous picture is
// repeated.
TEST_F(LfCompositorChangeTest, NoPictureMixesTwoRigs) {
  const ModifiedRig other(array_.rig(), [](Rig& rig) { rig.cameras[0].lens = Lens::pinhole(31, 15.5, 11.5); });
  const std::vector<CameraIndex> own[] = {{0}, {1, 2, 3}};  // one triangle belongs to the second node alone
  std::vector<size_t> order{0, 1, 2, 3};                    // the viewer, the two nodes, the compositor
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
      asked.view.lens = Lens::pinhole(15, 7.5, 5.5);
      gst_harness_set_time(harness_.get(), asked.target_time);
      request(asked);
      for (const size_t node : {0u, 1u}) {
        const bool second = is_new[1 + node];
        wire::Answer answer = answer_of(asked, own[node], second ? 220 : 50);
        answer.rig_hash = hash(second);
        if (second != is_new[0]) {
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
  } while (std::next_permutation(order.begin(), order.end()));
}

TEST_F(LfCompositorChangeTest, CamerasOutOfServiceAreForgottenWithTheirRig) {
  const ModifiedRig smaller(array_.rig(), [](Rig& rig) {
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
  ask({3});
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

TEST_F(LfCompositorChangeTest, UnreadableRigChangesNothing) {
  start(1, {{"rig", array_.rig_path()}});
  const ElementBus bus(element_.get());
  set_rig("/nowhere/rig.json");
  EXPECT_THAT(bus.warnings(), HasSubstr("/nowhere/rig.json"));
  ask_and_answer(0, 0, {0, 1, 2});
  LfCompositorTest::pull();
  EXPECT_EQ(stat(element_.get(), "missing-fragments"), 1u);
  EXPECT_EQ(get<std::string>(element_.get(), "rig"), array_.rig_path());
}

// Unsolicited answers, forged or left over from a restarted viewer, cost at most one picture.
class CompositorLimitsTest : public LfCompositorLiveTest {
 protected:
  // Sends a request and both nodes' answers. Returns true if the picture is complete.
  bool is_complete() {
    const uint64_t before = stat(element_.get(), "complete");
    const ViewRequest asked = ask();
    push(0, answer_of(asked, {0, 1}));
    push(1, answer_of(asked, {2, 3}));
    EXPECT_FALSE(pull().empty());
    return stat(element_.get(), "complete") == before + 1;
  }
  void begin() { start_live(2, {{"rig", array_.rig_path()}, {"max-missed", "2"}}); }
};

TEST_F(CompositorLimitsTest, ForgedAnswerCostsAtMostOnePicture) {
  begin();
  EXPECT_TRUE(is_complete());
  for (const uint32_t ahead : {uint32_t{1} << 30, 20u, 5u, 1u}) {
    ViewRequest forged = array_.request(sequence_ + ahead - 1, 77);
    push(0, answer_of(forged, {0, 1}, 30));
    int broken = 0;
    for (int i = 0; i < 8; i++) broken += !is_complete();
    EXPECT_LE(broken, 1) << ahead;
  }
  EXPECT_GT(stat(element_.get(), "unexpected-answers"), 0u);
  EXPECT_THAT(announced(), IsEmpty());
}

// Every later request would name these missing cameras, and nodes would refuse the requests.
TEST_F(CompositorLimitsTest, ForgedAnswerOfUnknownCamerasCostsNothing) {
  begin();
  for (int i = 0; i < 2; i++) EXPECT_TRUE(is_complete());
  for (const CameraIndex first : {900u, 2u}) {
    for (const uint32_t behind : {0u, 1u}) {  // requests directly after and before the current request
      const uint32_t number = sequence_ - behind;
      wire::Answer forged = answer_of(array_.request(number, kNow + number * kFrame), {0, 1});
      forged.fragments.clear();
      forged.cameras = {};
      forged.cameras.append({first, first == 900u ? first : kMaxCameras - 1});
      push(0, forged);
      for (int i = 0; i < 8; i++) EXPECT_TRUE(is_complete()) << first << ", " << behind;
    }
  }
  EXPECT_EQ(stat(element_.get(), "bad-answers"), 4u);
  EXPECT_THAT(announced(), IsEmpty());
}

TEST_F(CompositorLimitsTest, AnswerOfAnotherRigCostsAtMostOnePicture) {
  begin();
  EXPECT_TRUE(is_complete());
  for (const uint32_t ahead : {0u, 3u}) {
    ViewRequest next = array_.request(sequence_ + ahead, kNow + (sequence_ + ahead) * kFrame);
    wire::Answer forged = answer_of(next, {0, 1}, 30);
    forged.rig_hash ^= 1;
    push(0, forged);
    int broken = 0;
    for (int i = 0; i < 5; i++) broken += !is_complete();
    EXPECT_LE(broken, 1) << ahead;
  }
  EXPECT_EQ(stat(element_.get(), "rig-mismatches"), 2u);
}

TEST_F(CompositorLimitsTest, RestartedViewerIsServedAtOnce) {
  begin();
  for (int i = 0; i < 12; i++) EXPECT_TRUE(is_complete());
  for (uint32_t i = 0; i < 3; i++) push(0, answer_of(array_.request(sequence_ + i, 77), {0, 1}, 30));
  const uint32_t time = sequence_;
  for (uint32_t i = 0; i < 20; i++) {
    ViewRequest asked = array_.request(i, kNow + (time + i) * kFrame);
    gst_harness_set_time(harness_.get(), asked.target_time);
    request_and_answer(asked, {0, 1});
    push(1, answer_of(asked, {2, 3}));
    EXPECT_FALSE(pull().empty());
  }
  EXPECT_GE(stat(element_.get(), "complete"), 12u + 19u);
  EXPECT_THAT(announced(), IsEmpty());
}

TEST_F(CompositorLimitsTest, LimitsApplyToItsOwnRequests) {
  begin();
  ViewRequest large = array_.request(sequence_++, kNow);
  large.view.width = large.view.height = kMaxImageSize;
  request(large);
  EXPECT_TRUE(is_complete());
  EXPECT_EQ(stat(element_.get(), "refused-pixels"), 1u);
}

TEST_F(CompositorLimitsTest, EachLimitIsConfigurableAndCounted) {
  begin();
  const auto expect_refused = [this](const ViewRequest& asked, const char* counter) {
    const uint64_t before = stat(element_.get(), counter), all = stat(element_.get(), "refused");
    request(asked);
    EXPECT_EQ(stat(element_.get(), counter), before + 1) << counter;
    EXPECT_EQ(stat(element_.get(), "refused"), all + 1) << counter;
  };
  const auto set_limits = [this](const char* limits) {
    gst_util_set_object_arg(G_OBJECT(element_.get()), "limits", limits);
  };
  const auto next = [this] {
    const uint32_t sequence = sequence_++;
    return array_.request(sequence, kNow + sequence * kFrame);
  };

  set_limits("limits,max-pixels=100");
  expect_refused(next(), "refused-pixels");
  set_limits("limits,max-pixels=4194304");
  EXPECT_TRUE(is_complete());

  ViewRequest wide = next();
  wide.view.blending = {Blending::Kind::kAperture, 0.02, 0};
  set_limits("limits,max-aperture=0.01");
  expect_refused(wide, "refused-aperture");

  ViewRequest curious = next();
  curious.view.focus.map = flat_surface(curious.view);
  curious.hypotheses = {{DepthHypothesis::Kind::kBlurred, 0}, {DepthHypothesis::Kind::kPlane, 200}};
  set_limits("limits,max-hypotheses=1");
  expect_refused(curious, "refused-hypotheses");

  // Requests of one view that arrive in a burst: only the first ones fit into the limit per second.
  set_limits("limits,max-requests-per-second=5");
  for (int i = 0; i < 30; i++) {
    const uint64_t before = stat(element_.get(), "refused-rate");
    const ViewRequest asked = ask();
    if (stat(element_.get(), "refused-rate") > before) continue;
    push(0, answer_of(asked, {0, 1}));
    push(1, answer_of(asked, {2, 3}));
    EXPECT_FALSE(pull().empty()) << i;
  }
  EXPECT_GT(stat(element_.get(), "refused-rate"), 0u);
}

}  // namespace
}  // namespace lf::test
