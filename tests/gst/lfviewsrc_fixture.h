// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/array_fixture.h"

namespace lf::test {

using PadPtr = std::unique_ptr<GstPad, Unref<gst_object_unref>>;

inline constexpr double kTimeoutSeconds = 30;  // seconds; loaded machines are slow

inline bool becomes_true(const std::function<bool()>& what) {
  for (double t = 0; t < kTimeoutSeconds; t += 0.01) {
    if (what()) return true;
    g_usleep(10000);
  }
  return what();
}

inline ElementPtr make(const char* factory) {
  return ElementPtr(GST_ELEMENT(gst_object_ref_sink(gst_element_factory_make(factory, nullptr))));
}

inline ElementPtr launch_pipeline(const std::string& line) {
  ElementPtr launched = launch(line);
  if (!launched || GST_IS_PIPELINE(launched.get())) return launched;
  GstElement* pipeline = gst_pipeline_new(nullptr);
  gst_bin_add(GST_BIN(pipeline), launched.release());
  return ElementPtr(pipeline);
}

class LfViewSrcTest : public testing::Test {
 protected:
  // Plays a pipeline with an lfviewsrc "v" with these properties, followed by `behind`.
  void play(const std::string& properties, const std::string& behind = "v.src ! fakesink name=s sync=false") {
    pipeline_ = launch("lfviewsrc name=v rig=" + array_.rig_path() + " framerate=30/1 " + properties + " " + behind);
    ASSERT_TRUE(pipeline_);
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
    GstBus* bus = gst_element_get_bus(pipeline_.get());
    gst_bus_set_flushing(bus, TRUE);
    gst_object_unref(bus);
    pipeline_.reset();
  }

  std::string error() {
    GstBus* bus = gst_element_get_bus(pipeline_.get());
    GstMessage* message = gst_bus_pop_filtered(bus, GST_MESSAGE_ERROR);
    gst_object_unref(bus);
    if (!message) return "";
    g_autoptr(GError) error = nullptr;
    gst_message_parse_error(message, &error, nullptr);
    gst_message_unref(message);
    return error->message;
  }
  ElementPtr child(const std::string& name) const {
    return ElementPtr(gst_bin_get_by_name(GST_BIN(pipeline_.get()), name.c_str()));
  }
  template <typename T = double>
  T get(const std::string& element, const char* property) const {
    T value{};
    g_object_get(child(element).get(), property, &value, nullptr);
    return value;
  }
  void count(GstElement* sink, const std::string& name) {
    const PadPtr pad(gst_element_get_static_pad(sink, "sink"));
    const auto probe = [](GstPad*, GstPadProbeInfo*, gpointer counter) {
      ++*static_cast<std::atomic<int>*>(counter);
      return GST_PAD_PROBE_OK;
    };
    gst_pad_add_probe(pad.get(), GST_PAD_PROBE_TYPE_BUFFER, probe, &shown_[name], nullptr);
  }
  bool more(const std::string& sink, int pictures = 5) {
    const int before = shown_[sink];
    return becomes_true([&] { return shown_[sink] >= before + pictures; });
  }
  // Adds a viewer and its sink while playing. Returns the viewer's pad.
  PadPtr add_viewer(const std::string& sink_name) {
    const ElementPtr v = child("v");
    PadPtr pad(gst_element_request_pad_simple(v.get(), "src_%u"));
    GstElement* sink = gst_element_factory_make("fakesink", sink_name.c_str());
    g_object_set(sink, "sync", FALSE, "async", FALSE, nullptr);
    gst_bin_add(GST_BIN(pipeline_.get()), sink);
    count(sink, sink_name);
    const PadPtr in(gst_element_get_static_pad(sink, "sink"));
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
  ElementPtr pipeline_;
  std::map<std::string, std::atomic<int>> shown_;
};

}  // namespace lf::test
