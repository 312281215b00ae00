// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include <gst/gst.h>

#include "base/file.h"
#include "image/image.h"
#include "rig/source_security.h"

namespace lf {

// Returns the first error on the pipeline's bus, waiting up to `timeout`, or `otherwise` if there is none. Removes the
// message from the bus.
inline std::string bus_error(GstElement* pipeline, GstClockTime timeout, std::string otherwise) {
  GstBus* bus = gst_element_get_bus(pipeline);
  if (GstMessage* message = gst_bus_timed_pop_filtered(bus, timeout, GST_MESSAGE_ERROR)) {
    GError* error = nullptr;
    gst_message_parse_error(message, &error, nullptr);
    otherwise = redacted_location(error->message);
    g_error_free(error);
    gst_message_unref(message);
  }
  gst_object_unref(bus);
  return otherwise;
}

}  // namespace lf

// Frames per second as a fraction.
struct FrameRate {
  int numerator = 15, denominator = 1;
  // Returns the time of frame `n`, counted from 0, nanoseconds.
  GstClockTime time(uint64_t n) const {
    return gst_util_uint64_scale(n, GST_SECOND * static_cast<guint64>(denominator), static_cast<guint64>(numerator));
  }
};

// Writes Motion JPEG into a Matroska file through GStreamer. finish() replaces the file atomically (base/file.h);
// without finish() nothing changes. Not thread-safe. Throws lf::Error that names the file. Requires gst_init().
class MjpegWriter {
 public:
  // Encodes images. `quality`: JPEG quality, 1..100. `rate` 0/1: every frame has its own time.
  MjpegWriter(const std::string& path, int width, int height, FrameRate rate, int quality);
  // Stores frames that are already JPEG without re-encoding.
  MjpegWriter(const std::string& path, int width, int height);
  ~MjpegWriter();
  MjpegWriter(const MjpegWriter&) = delete;
  MjpegWriter& operator=(const MjpegWriter&) = delete;

  // Writes the next RGB frame of the writer's size, at the time given by the rate.
  void add(const lf::Image& rgb) { add(rgb, rate_.time(frames_)); }
  // Writes a frame at `time`, nanoseconds, which must increase. Without a rate, time 0 is common to all films of a
  // recording, even if no frame was taken then.
  void add(const lf::Image& rgb, GstClockTime time);
  void add_jpeg(GstBuffer* jpeg, GstClockTime time);  // `jpeg` is borrowed
  void finish();

 private:
  void open(const std::string& coder, GstCaps* caps);  // takes ownership of `caps`
  void write_beginning();
  void push(GstBuffer* buffer, GstClockTime time);  // takes ownership of `buffer`
  void close();
  [[noreturn]] void fail();  // throws lf::Error with the pipeline's error

  std::string path_;
  lf::AtomicFileWriter file_;
  FrameRate rate_;
  uint64_t frames_ = 0;
  GstElement* pipeline_ = nullptr;
  GstElement* source_ = nullptr;
};
