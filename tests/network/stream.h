// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/app/gstappsink.h>
#include <gst/app/gstappsrc.h>

#include <string>
#include <vector>

#include "gst/gst_test.h"

// What the tests of streams between pipelines share.
namespace lf::test {

inline constexpr char kAnswers[] = "application/x-lightfield-answer";
inline constexpr char kRequests[] = "application/x-lightfield-request,framerate=30/1";

// A pipeline that is stopped with the object.
class Running {
 public:
  explicit Running(const std::string& line) : pipeline_(launch(line)) {}
  ~Running() {
    if (pipeline_) gst_element_set_state(pipeline_.get(), GST_STATE_NULL);
  }
  Running(const Running&) = delete;
  void play() { gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING); }
  GstElement* get() { return pipeline_.get(); }
  ElementPtr child(const char* name) { return ElementPtr(gst_bin_get_by_name(GST_BIN(pipeline_.get()), name)); }
  // The error it ended with, or nothing.
  std::string error() {
    const std::unique_ptr<GstBus, Unref<gst_object_unref>> bus(gst_element_get_bus(pipeline_.get()));
    GstMessage* message = gst_bus_pop_filtered(bus.get(), GST_MESSAGE_ERROR);
    if (!message) return "";
    GError* error = nullptr;
    gchar* debug = nullptr;
    gst_message_parse_error(message, &error, &debug);
    const std::string text = std::string(error->message) + " (" + (debug ? debug : "") + ")";
    g_clear_error(&error);
    g_free(debug);
    gst_message_unref(message);
    return text;
  }

 private:
  ElementPtr pipeline_;
};

// Ends in `appsink name=out sync=false`.
class Receiver : public Running {
 public:
  using Running::Running;
  // Until there are `count` buffers in all, or nothing has come for `seconds`.
  const std::vector<std::vector<uint8_t>>& take(size_t count, double seconds = 5) {
    const ElementPtr out = child("out");
    while (buffers_.size() < count) {
      GstSample* sample =
          gst_app_sink_try_pull_sample(GST_APP_SINK(out.get()), static_cast<GstClockTime>(seconds * GST_SECOND));
      if (!sample) break;
      buffers_.push_back(to_bytes(gst_sample_get_buffer(sample)));
      gst_sample_unref(sample);
    }
    return buffers_;
  }
  // The port that `udpsrc name=NAME port=0` has been given.
  std::string port(const char* name = "udp") {
    gst_element_set_state(get(), GST_STATE_PAUSED);
    gint port = 0;
    g_object_get(child(name).get(), "port", &port, nullptr);
    return std::to_string(port);
  }

 private:
  std::vector<std::vector<uint8_t>> buffers_;
};

// Begins with `appsrc name=in`.
class Sender : public Running {
 public:
  Sender(const char* caps, const std::string& rest)
      : Running(std::string("appsrc name=in is-live=true format=time caps=") + caps + " ! " + rest) {
    play();
  }
  void send(const std::vector<uint8_t>& unit) {
    GstBuffer* buffer = to_buffer(unit);
    GST_BUFFER_PTS(buffer) = sent_++ * 10 * GST_MSECOND;
    gst_app_src_push_buffer(GST_APP_SRC(child("in").get()), buffer);
  }

 private:
  guint64 sent_ = 0;
};

}  // namespace lf::test
