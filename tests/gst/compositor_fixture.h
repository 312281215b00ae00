// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstaggregator.h>
#include <gst/video/video.h>

#include "gst/array_fixture.h"
#include "support/answers.h"
#include "wire/request_codec.h"

namespace lf::test {

struct Hooks {
  std::function<void()> aggregate = [] {};
  std::function<void()> negotiate = [] {};
  std::function<GstFlowReturn(GstCaps* downstream, GstCaps** caps)> update_caps;
  std::function<bool(GstCaps* caps)> negotiated;
  std::function<bool(GstQuery* query)> allocation;
};

// Returns a floating reference. `hooks` must outlive the element.
GstElement* new_test_aggregator(Hooks* hooks);

class LfCompositorTest : public testing::Test {
 protected:
  void start(int nodes, const std::vector<std::pair<std::string, std::string>>& properties = {},
             const char* sink_caps = nullptr) {
    nodes_.clear();
    harness_.reset();
    element_ = make_element("lfcompositor");
    for (const auto& [name, value] : properties)
      gst_util_set_object_arg(G_OBJECT(element_.get()), name.c_str(), value.c_str());
    harness_.reset(gst_harness_new_with_element(element_.get(), "request", "src"));
    gst_harness_set_live(harness_.get(), live_);
    if (sink_caps) gst_harness_set_sink_caps_str(harness_.get(), sink_caps);
    gst_harness_set_src_caps_str(harness_.get(), "application/x-lightfield-request,framerate=10/1");
    for (int i = 0; i < nodes; i++) {
      nodes_.emplace_back(gst_harness_new_with_element(element_.get(), ("sink_" + std::to_string(i)).c_str(), nullptr));
      gst_harness_set_live(nodes_.back().get(), live_);
      gst_harness_set_src_caps_str(nodes_.back().get(), "application/x-lightfield-answer");
    }
  }

  void request(const ViewRequest& request) {
    GstBuffer* buffer = to_buffer(wire::encode_request(request));
    GST_BUFFER_PTS(buffer) = request.target_time;  // requests leave at their target time
    GST_BUFFER_DURATION(buffer) = kFrame;
    ASSERT_EQ(gst_harness_push(harness_.get(), buffer), GST_FLOW_OK);
  }

  wire::Answer answer_of(const ViewRequest& request, std::vector<CameraIndex> cameras, uint8_t grey = 200,
                         PixelFamily family = PixelFamily::kRgb) {
    const Rig& rig = array_.rig();
    Image image(family, ArrayFixture::kWidth, ArrayFixture::kHeight);
    std::fill(image.data().begin(), image.data().end(), uint8_t{128});
    const size_t grey_bytes =
        family == PixelFamily::kRgb ? image.data().size() : ArrayFixture::kWidth * ArrayFixture::kHeight;
    std::fill_n(image.data().begin(), grey_bytes, grey);
    return node_answer(rig, request, cameras, image);
  }

  void push(size_t node, const std::vector<uint8_t>& bytes) {
    ASSERT_EQ(gst_harness_push(nodes_[node].get(), to_buffer(bytes)), GST_FLOW_OK);
  }
  void push(size_t node, const wire::Answer& answer) { push(node, wire::encode_answer(answer)); }

  // Sends a request and the answer of node 0.
  void request_and_answer(const ViewRequest& asked, const std::vector<CameraIndex>& cameras, uint8_t grey = 200,
                          PixelFamily family = PixelFamily::kRgb) {
    request(asked);
    push(0, answer_of(asked, cameras, grey, family));
  }
  ViewRequest ask_and_answer(uint32_t sequence, uint64_t time, const std::vector<CameraIndex>& cameras) {
    const ViewRequest asked = array_.request(sequence, time);
    request_and_answer(asked, cameras);
    return asked;
  }

  std::vector<uint8_t> pull() {
    const BufferPtr buffer(gst_harness_pull(harness_.get()));
    if (!buffer) {
      ADD_FAILURE() << "no picture";
      return {};
    }
    last_pts_ = GST_BUFFER_PTS(buffer.get());
    return to_bytes(buffer.get());
  }

  std::string output_format() {
    const CapsPtr caps(gst_pad_get_current_caps(harness_->sinkpad));
    return gst_structure_get_string(gst_caps_get_structure(caps.get(), 0), "format");
  }

  static std::pair<int, int> range(const std::vector<uint8_t>& bytes) {
    const auto [low, high] = std::minmax_element(bytes.begin(), bytes.end());
    return {*low, *high};
  }

  ArrayFixture array_;
  ElementPtr element_;
  HarnessPtr harness_;
  std::vector<HarnessPtr> nodes_;
  uint64_t last_pts_ = 0;
  gboolean live_ = FALSE;  // for start(), because the element's thread queries it after the first event
};

}  // namespace lf::test
