// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "composite/camera_health.h"
#include "gst/compositor_live_fixture.h"
#include "support/halves.h"
#include "wire/answer_parser.h"
#include "wire/answer_writer.h"
#include "wire/payload.h"

namespace lf::test {
namespace {

// As capture-delay grows, where the application does not heed the message.
TEST_F(LfCompositorLiveTest, ALatencyThatHasGrownIsFollowed) {
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
  EXPECT_EQ(gst_harness_buffers_in_queue(harness_.get()), 0u) << "its answer is not late yet";
  push(0, answer_of(asked, {0, 1, 2, 3}));
  EXPECT_GE(range(pull()).first, 199);
}

using testing::ElementsAre;
using testing::IsEmpty;

TEST_F(LfCompositorLiveTest, APictureIsOutAtItsDeadlineWithoutTheSilentNode) {
  start_live(2, {{"rig", array_.rig_path()}});
  const ViewRequest asked = ask();
  push(0, answer_of(asked, {0, 1, 2}));
  pass_deadline();
  pull();
  EXPECT_EQ(stat(element_.get(), "missing-fragments"), 1u);
  EXPECT_THAT(announced(), IsEmpty());
}

// Both of the nodes have two cameras; the first one stops after the first picture.
TEST_F(LfCompositorLiveTest, ANodeThatStopsIsLeftOutAndComesBack) {
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

  // From now on nobody waits for it, and the picture has no hole.
  for (int i = 0; i < 3; i++) {
    asked = ask({2, 3});
    if (i > 0) settle(30);  // the answer comes to a compositor that waits for it
    push(1, answer_of(asked, {0, 1}));
    const std::vector<uint8_t> healed = pull();
    ASSERT_FALSE(healed.empty());
    EXPECT_GE(range(healed).first, 199);
    EXPECT_EQ(stat(element_.get(), "missing-fragments"), 6u);
  }

  // It is back: its first answer comes too late for the picture, but in time.
  wire::Answer nothing;
  for (unsigned i = 0; i < CameraHealth::kBackAfter + 1 && stat(element_.get(), "out-of-service") > 0; i++) {
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

TEST_F(LfCompositorLiveTest, ABlindCameraIsTakenOut) {
  start_live(1, {{"max-missed", "1"}});
  for (int i = 0; i < 3; i++) {
    const ViewRequest asked = ask();
    wire::Answer answer = answer_of(asked, i == 0 ? CameraSet{0, 1, 2, 3} : CameraSet{0, 1, 2});
    answer.cameras = CameraRanges(CameraSet{0, 1, 2, 3});
    if (i > 0) answer.blind = CameraRanges(CameraSet{3});
    push(0, answer);
    pull();
  }
  EXPECT_THAT(announced(), ElementsAre(CameraSet{3}));
}

TEST_F(LfCompositorLiveTest, WhereNothingComesThePictureBeforeShows) {
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
    nodes_.clear();
    harness_.reset();
    sequence_ = 0;
  }
}

// An answer in two parts, of its upper half and of its lower one.
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

TEST_F(LfCompositorLiveTest, PartsOfAnswersComeInAnyOrderAndMoreThanOnce) {
  start_live(2, {{"rig", array_.rig_path()}});
  for (const std::vector<size_t>& order : {std::vector<size_t>{0, 1}, {1, 0}, {1, 1, 0}}) {
    const ViewRequest asked = ask();
    push(0, answer_of(asked, {0}));
    const auto parts = in_parts(answer_of(asked, {1, 2, 3}));
    for (const size_t i : order)
      ASSERT_EQ(gst_harness_push(nodes_[1].get(), to_buffer(std::vector<uint8_t>(parts[i]))), GST_FLOW_OK);
    EXPECT_GE(range(pull()).first, 199);
  }
  EXPECT_EQ(stat(element_.get(), "repeated-answers"), 1u);
  EXPECT_EQ(stat(element_.get(), "bad-answers"), 0u);
  EXPECT_EQ(stat(element_.get(), "incomplete"), 0u);
}

TEST_F(LfCompositorLiveTest, ALostPartIsConcealedAtTheDeadline) {
  start_live(2, {{"rig", array_.rig_path()}});
  const ViewRequest asked = ask();
  push(0, answer_of(asked, {0}));
  const auto parts = in_parts(answer_of(asked, {1, 2, 3}));
  ASSERT_EQ(gst_harness_push(nodes_[1].get(), to_buffer(std::vector<uint8_t>(parts[1]))), GST_FLOW_OK);
  pass_deadline();
  const std::vector<uint8_t> picture = pull();
  EXPECT_EQ(stat(element_.get(), "missing-fragments"), 3u);
  EXPECT_NEAR(picture[(4 * 16 + 6) * 3], 200, 6);
  EXPECT_NEAR(picture[(8 * 16 + 6) * 3], 200, 1);
}

}  // namespace
}  // namespace lf::test
