// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/array_fixture.h"
#include "support/answers.h"
#include "wire/request_codec.h"

namespace lf::test {

class LfFragmentTest : public testing::Test {
 protected:
  void start(int cameras, const char* format = "RGB", bool live = false) {
    element_.reset(GST_ELEMENT(gst_object_ref_sink(gst_element_factory_make("lffragment", nullptr))));
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

  void set(const char* property, const char* value) {
    gst_util_set_object_arg(G_OBJECT(element_.get()), property, value);
  }

  void push_frames(uint8_t value, uint64_t time, const char* format = "RGB") {
    for (const HarnessPtr& camera : cameras_)
      ASSERT_EQ(gst_harness_push(camera.get(), ArrayFixture::frame(format, value, time)), GST_FLOW_OK);
  }

  GstFlowReturn request(const ViewRequest& request) {
    GstBuffer* buffer = to_buffer(wire::encode_request(request));
    GST_BUFFER_PTS(buffer) = request.target_time;
    GST_BUFFER_DURATION(buffer) = kFrame;
    return gst_harness_push(harness_.get(), buffer);
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
  std::vector<std::string> warnings(GstMessageType type = GST_MESSAGE_WARNING) {
    std::vector<std::string> texts;
    while (GstMessage* message = gst_bus_pop_filtered(bus_.get(), type)) {
      g_autoptr(GError) error = nullptr;
      const auto parse = type == GST_MESSAGE_WARNING ? gst_message_parse_warning : gst_message_parse_error;
      parse(message, &error, nullptr);
      texts.emplace_back(error->message);
      gst_message_unref(message);
    }
    return texts;
  }

  std::unique_ptr<GstBus, Unref<gst_object_unref>> bus_;
  ArrayFixture array_;
  ElementPtr element_;
  std::vector<HarnessPtr> cameras_;
  HarnessPtr harness_;
  uint64_t last_pts_ = 0;
};

}  // namespace lf::test
