// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/array_fixture.h"

namespace lf::test {

inline constexpr double kTimeoutSeconds = 30;  // seconds; loaded machines are slow

class LfViewSrcTest : public testing::Test {
 protected:
  // Plays a pipeline with an lfviewsrc "v" with these properties, followed by `behind`.
  void play(const std::string& properties, const std::string& behind = "v.src ! fakesink name=s sync=false") {
    pipeline_ = launch("lfviewsrc name=v rig=" + array_.rig_path() + " framerate=30/1 " + properties + " " + behind);
    for (const char* sink : {"s", "t"})
      if (const ElementPtr element = child(sink)) count(element.get(), sink);
    ASSERT_NE(gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE) << error();
  }
  void TearDown() override { stop(); }
  void stop() {
    if (!pipeline_) return;
    EXPECT_EQ(gst_element_set_state(pipeline_.get(), GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
    EXPECT_EQ(error(), "");
    pipeline_.reset();
  }

  void drop() {
    gst_element_set_state(pipeline_.get(), GST_STATE_NULL);
    g_autoptr(GstBus) bus = gst_element_get_bus(pipeline_.get());
    gst_bus_set_flushing(bus, TRUE);
    pipeline_.reset();
  }

  std::string error() {
    g_autoptr(GstBus) bus = gst_element_get_bus(pipeline_.get());
    const MessagePtr message(gst_bus_pop_filtered(bus, GST_MESSAGE_ERROR));
    return message ? text_of(message.get()) : "";
  }
  ElementPtr child(const std::string& name) const { return child_of(pipeline_.get(), name); }
  template <typename T = double>
  T get(const std::string& element, const char* property) const {
    return test::get<T>(child(element).get(), property);
  }
  void count(GstElement* sink, const std::string& name) {
    on_buffers(sink, "sink", [&shown = shown_[name]](GstBuffer*) { ++shown; });
  }
  bool more(const std::string& sink, int pictures = 5) {
    const int before = shown_[sink];
    return eventually([&] { return shown_[sink] >= before + pictures; });
  }
  // Adds a viewer and its sink while playing. Returns the viewer's pad.
  PadPtr add_viewer(const std::string& sink_name) {
    const ElementPtr v = child("v");
    PadPtr pad(gst_element_request_pad_simple(v.get(), "src_%u"));
    GstElement* sink = gst_element_factory_make("fakesink", sink_name.c_str());
    g_object_set(sink, "sync", FALSE, "async", FALSE, nullptr);
    gst_bin_add(GST_BIN(pipeline_.get()), sink);
    count(sink, sink_name);
    const PadPtr in = pad_of(sink, "sink");
    gst_element_sync_state_with_parent(sink);
    EXPECT_EQ(gst_pad_link(pad.get(), in.get()), GST_PAD_LINK_OK);
    return pad;
  }
  void close_viewer(GstPad* pad, const std::string& sink_name) {
    const ElementPtr v = child("v"), sink = child(sink_name);
    gst_element_release_request_pad(v.get(), pad);
    gst_element_set_state(sink.get(), GST_STATE_NULL);
    gst_bin_remove(GST_BIN(pipeline_.get()), sink.get());
  }

  ArrayFixture array_;
  PipelinePtr pipeline_;
  std::map<std::string, std::atomic<int>> shown_;
};

}  // namespace lf::test
