// SPDX-License-Identifier: LGPL-2.1-or-later
#include "compositor/node_input.h"

#include "gst/compositor_fixture.h"

namespace lf::test {
namespace {

using UnitResult = NodeInput::UnitResult;

// Units of 24 bytes with the request number where answers have it, the part's index, and the number of parts.
class NodeInputTest : public testing::Test {
 protected:
  NodeInputTest() {
    g_object_set(element_, "latency", 10 * GST_SECOND, nullptr);  // allows several buffers to wait on a pad
    // GstAggregator waits as long as this pad has no buffer.
    gst_object_unref(gst_element_request_pad_simple(element_, "sink_%u"));
    harness_.reset(gst_harness_new_with_element(element_, "sink_%u", nullptr));
    gst_harness_set_src_caps_str(harness_.get(), "answers");
    pad_ = GST_AGGREGATOR_PAD(gst_pad_get_peer(harness_->srcpad));
    NodeInput::attach(pad_);
  }
  ~NodeInputTest() override {
    gst_object_unref(pad_);
    harness_.reset();
    gst_object_unref(element_);
  }
  NodeInput& node() { return NodeInput::of(pad_); }
  void come(uint8_t sequence, uint8_t part = 0, uint8_t parts = 1) {
    std::vector<uint8_t> bytes(24);
    bytes[19] = sequence;
    bytes[20] = part;
    bytes[21] = parts;
    GstBuffer* unit = to_buffer(bytes);
    GST_BUFFER_PTS(unit) = 0;
    ASSERT_EQ(gst_harness_push(harness_.get(), unit), GST_FLOW_OK);
    // GstAggregator's thread takes the caps and the segment from the queue before the first buffer.
    ASSERT_TRUE(eventually([&] { return has_buffer(); }));
  }
  std::vector<int> take(uint8_t sequence, bool live = false) {
    std::vector<int> parts;
    node().take(sequence, live, [&](GstBuffer* unit) {
      const std::vector<uint8_t> bytes = to_bytes(unit);
      if (bytes[19] > sequence) return UnitResult::kEarly;
      if (bytes[19] < sequence) return UnitResult::kDone;
      parts.push_back(bytes[20]);
      return node().add_part({.first = bytes[20], .count = 1, .total = bytes[21]}) ? node().part_added(true)
                                                                                   : UnitResult::kDone;
    });
    return parts;
  }
  bool has_buffer() { return gst_aggregator_pad_has_buffer(pad_); }

  Hooks hooks_;
  GstElement* element_ = GST_ELEMENT(gst_object_ref_sink(new_test_aggregator(&hooks_)));
  HarnessPtr harness_;
  GstAggregatorPad* pad_ = nullptr;
};

TEST_F(NodeInputTest, LastPartStaysOnThePadUntilThePictureIsDone) {
  come(1, 0, 2);
  EXPECT_TRUE(node().has_unread());
  EXPECT_EQ(take(1), std::vector({0}));
  EXPECT_TRUE(node().is_awaited(false, 0));
  EXPECT_FALSE(has_buffer());
  come(1, 1, 2);
  EXPECT_EQ(take(1), std::vector({1}));
  EXPECT_FALSE(node().is_awaited(false, 0));
  EXPECT_TRUE(has_buffer()) << "visible to GstAggregator";
  EXPECT_FALSE(node().has_unread());
  EXPECT_EQ(take(1), std::vector<int>());
  node().close(true);
  EXPECT_FALSE(has_buffer());
  EXPECT_TRUE(node().is_awaited(false, 0)) << "answer to the next request";
}

TEST_F(NodeInputTest, AnswerToALaterRequestWaitsOnThePad) {
  come(3);
  EXPECT_EQ(take(1), std::vector<int>());
  EXPECT_FALSE(node().is_awaited(false, 0)) << "the node has skipped this request";
  EXPECT_FALSE(node().has_unread());
  node().close(true);
  node().forget();
  EXPECT_EQ(take(3), std::vector({0}));
}

TEST_F(NodeInputTest, LiveAnswerToALaterRequestIsKept) {
  come(3);
  come(1);
  EXPECT_EQ(take(1, true), std::vector({0})) << "later answers are not delayed";
  node().close(true);
  EXPECT_FALSE(has_buffer());
  node().forget();
  EXPECT_EQ(take(2, true), std::vector<int>());
  node().forget();
  EXPECT_EQ(take(3, true), std::vector({0}));
  EXPECT_FALSE(node().is_awaited(true, 0));
}

TEST_F(NodeInputTest, LiveNodeThatMissedPicturesIsNotAwaited) {
  for (int i = 0; i < 3; i++) {
    EXPECT_TRUE(node().is_awaited(true, 2)) << i;
    node().close(true);
  }
  EXPECT_FALSE(node().is_awaited(true, 2));
  EXPECT_TRUE(node().is_awaited(true, 0)) << "without limit";
  EXPECT_TRUE(node().is_awaited(false, 2)) << "from files";
  node().was_in_time();
  EXPECT_TRUE(node().is_awaited(true, 2));
  for (int i = 0; i < 3; i++) node().close(false);
  EXPECT_TRUE(node().is_awaited(true, 2)) << "pictures without information about the node";
}

TEST_F(NodeInputTest, FlushDiscardsAnswers) {
  come(3);
  EXPECT_EQ(take(1, true), std::vector<int>());
  node().flushed();
  EXPECT_EQ(take(3, true), std::vector<int>());
  come(3);
  EXPECT_EQ(take(3, true), std::vector({0}));
}

TEST_F(NodeInputTest, SkippedRequestLeavesNothingBehind) {
  come(1);
  EXPECT_EQ(take(1), std::vector({0}));
  node().drop_answer();
  EXPECT_FALSE(has_buffer());
  node().forget();
  come(2);
  EXPECT_EQ(take(2), std::vector({0}));
}

TEST_F(NodeInputTest, RepeatedPartIsIgnored) {
  come(1, 0, 2);
  come(1, 0, 2);
  EXPECT_EQ(take(1), std::vector({0, 0}));
  EXPECT_TRUE(node().is_awaited(false, 0)) << "the other part is missing";
}

}  // namespace
}  // namespace lf::test
