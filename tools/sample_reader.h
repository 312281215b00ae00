// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <string>
#include <utility>

#include <gst/app/gstappsink.h>
#include <gst/gst.h>

#include "base/text.h"
#include "rig/source_security.h"

namespace lf {

// Waits up to `timeout` for an error on the pipeline's bus, and takes it from the bus. Returns the text of the error,
// or `otherwise` if there is none.
inline std::string bus_error(GstElement* pipeline, GstClockTime timeout, std::string otherwise) {
  g_autoptr(GstBus) bus = gst_element_get_bus(pipeline);
  g_autoptr(GstMessage) message = gst_bus_timed_pop_filtered(bus, timeout, GST_MESSAGE_ERROR);
  if (message) {
    g_autoptr(GError) error = nullptr;
    gst_message_parse_error(message, &error, nullptr);
    otherwise = redacted_location(error->message);
  }
  return otherwise;
}

// Reads samples from the appsink "sink" of a launch line.
class SampleReader {
 public:
  struct Unref {
    void operator()(GstElement* element) const { gst_object_unref(element); }
    void operator()(GstSample* sample) const { gst_sample_unref(sample); }
  };
  using Element = std::unique_ptr<GstElement, Unref>;
  using Sample = std::unique_ptr<GstSample, Unref>;

  // `name` is the source in the messages of errors. Throws Error if the launch line is invalid.
  SampleReader(const std::string& line, std::string name) : name_(std::move(name)) {
    g_autoptr(GError) error = nullptr;
    pipeline_.reset(gst_parse_launch(line.c_str(), &error));
    if (error) throw Error(name_ + ": " + error->message);
    sink_ = child("sink");
  }
  ~SampleReader() {
    if (pipeline_) gst_element_set_state(pipeline_.get(), GST_STATE_NULL);
  }
  SampleReader(const SampleReader&) = delete;

  Element child(const char* name) const { return Element(gst_bin_get_by_name(GST_BIN(pipeline_.get()), name)); }
  GstElement* pipeline() const { return pipeline_.get(); }

  // Starts the pipeline. Throws Error.
  void start() {
    if (gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING) == GST_STATE_CHANGE_FAILURE)
      throw Error(name_ + ": " + bus_error(pipeline_.get(), 0, "cannot be read"));
  }
  // Waits for the next sample. Returns null at the end. Throws Error if the pipeline fails.
  Sample next() {
    for (;;) {
      Sample sample(gst_app_sink_try_pull_sample(GST_APP_SINK(sink_.get()), GST_SECOND / 10));
      if (sample) return sample;
      if (const std::string reason = bus_error(pipeline_.get(), 0, ""); !reason.empty())
        throw Error(name_ + ": " + reason);
      if (gst_app_sink_is_eos(GST_APP_SINK(sink_.get()))) return sample;
    }
  }

 private:
  const std::string name_;
  Element pipeline_, sink_;
};

}  // namespace lf
