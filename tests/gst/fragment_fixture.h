// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/array_fixture.h"
#include "support/answers.h"
#include "wire/request_codec.h"

namespace lf::test {

class LfFragmentTest : public testing::Test {
 protected:
  // Starts a new element.
  virtual void start(int cameras, const char* format = "RGB", bool live = false) {
    cameras_.clear();
    harness_.reset();
    element_ = make_element("lffragment");
    g_object_set(element_.get(), "rig", array_.rig_path().c_str(), "node", 7u, nullptr);
    harness_.reset(gst_harness_new_with_element(element_.get(), "request", "src"));
    gst_harness_set_live(harness_.get(), FALSE);
    for (int i = 0; i < cameras; i++) {
      const std::string pad = "sink_" + std::to_string(i);
      cameras_.emplace_back(gst_harness_new_with_element(element_.get(), pad.c_str(), nullptr));
      gst_harness_set_live(cameras_.back().get(), live);
      if (format) gst_harness_set_src_caps_str(cameras_.back().get(), ArrayFixture::caps(format).c_str());
    }
    gst_harness_set_src_caps_str(harness_.get(), "application/x-lightfield-request,framerate=10/1");
  }

  // Starts cameras and sends a uniform frame of each.
  void start_showing(uint8_t value, int cameras = 4) {
    start(cameras);
    push_frames(value, 0);
  }

  void set(const char* property, const char* value) {
    gst_util_set_object_arg(G_OBJECT(element_.get()), property, value);
  }

  static void push_frame(const HarnessPtr& camera, uint8_t value, uint64_t time, const char* format = "RGB") {
    ASSERT_EQ(gst_harness_push(camera.get(), ArrayFixture::frame(format, value, time)), GST_FLOW_OK);
  }
  void push_frames(uint8_t value, uint64_t time, const char* format = "RGB") {
    for (const HarnessPtr& camera : cameras_) push_frame(camera, value, time, format);
  }
  // Makes the requests a live stream, so the element waits for no camera.
  void make_live() {
    gst_harness_set_live(harness_.get(), TRUE);
    push_segment(harness_.get());
  }
  void end_cameras() {
    for (const HarnessPtr& camera : cameras_) gst_harness_push_event(camera.get(), gst_event_new_eos());
  }

  GstFlowReturn push(const std::vector<uint8_t>& bytes) { return gst_harness_push(harness_.get(), to_buffer(bytes)); }
  GstFlowReturn request(const ViewRequest& request) {
    GstBuffer* buffer = to_buffer(wire::encode_request(request));
    GST_BUFFER_PTS(buffer) = request.target_time;
    GST_BUFFER_DURATION(buffer) = kFrame;
    return gst_harness_push(harness_.get(), buffer);
  }

  // Returns the answer to a request.
  wire::Answer answer_to(const ViewRequest& asked) {
    EXPECT_EQ(request(asked), GST_FLOW_OK);
    return pull();
  }
  wire::Answer pull() {
    const BufferPtr buffer(gst_harness_pull(harness_.get()));
    if (!buffer) {
      ADD_FAILURE() << "no answer";
      return {};
    }
    last_pts_ = GST_BUFFER_PTS(buffer.get());
    std::string reason;
    const std::optional<wire::Answer> answer = wire::decode_answer(to_bytes(buffer.get()), &reason);
    EXPECT_TRUE(answer) << reason;
    return answer.value_or(wire::Answer{});
  }

  std::pair<int, int> picture_range(const ViewRequest& request, const wire::Answer& answer) {
    Assembly assembly;
    assembly.begin(request);
    EXPECT_EQ(add_answer(assembly, answer), Assembly::Verdict::kAdded);
    assembly.finish(PixelFamily::kRgb, false);
    const Image picture = assembly.picture().resolve();
    const auto [low, high] = std::minmax_element(picture.data().begin(), picture.data().end());
    return {*low, *high};
  }

  void listen() {
    bus_.reset(gst_bus_new());
    gst_element_set_bus(element_.get(), bus_.get());
  }
  std::vector<std::string> warnings(GstMessageType type = GST_MESSAGE_WARNING) { return texts_on(bus_.get(), type); }

  BusPtr bus_;
  ArrayFixture array_;
  ElementPtr element_;
  std::vector<HarnessPtr> cameras_;
  HarnessPtr harness_;
  uint64_t last_pts_ = 0;
};

}  // namespace lf::test
