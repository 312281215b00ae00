// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include <gst/gst.h>

#include "base/file.h"
#include "image/image.h"
#include "rig/source_security.h"

namespace lf {

// What the first error says that is on the pipeline's bus, or comes there within `patience`; `otherwise` if none does.
// The message is taken off the bus.
inline std::string posted_error(GstElement* pipeline, GstClockTime patience, std::string otherwise) {
  GstBus* bus = gst_element_get_bus(pipeline);
  if (GstMessage* message = gst_bus_timed_pop_filtered(bus, patience, GST_MESSAGE_ERROR)) {
    GError* error = nullptr;
    gst_message_parse_error(message, &error, nullptr);
    otherwise = location_text(error->message);
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
  // The time of frame `n`, counted from 0, nanoseconds.
  GstClockTime time(uint64_t n) const {
    return gst_util_uint64_scale(n, GST_SECOND * static_cast<guint64>(denominator), static_cast<guint64>(numerator));
  }
};

// Motion JPEG in a Matroska file, through GStreamer. finish() replaces the file as a whole (base/file.h); without it
// nothing changes. One thread at a time. Throws lf::Error naming the file. gst_init() must have been called.
class MjpegWriter {
 public:
  // Writes pictures. `quality`: JPEG's, 1..100. `rate`: 0/1 where every frame comes with its time.
  MjpegWriter(const std::string& path, int width, int height, FrameRate rate, int quality);
  // Of frames that are JPEG already, which go to the file as they are.
  MjpegWriter(const std::string& path, int width, int height);
  ~MjpegWriter();
  MjpegWriter(const MjpegWriter&) = delete;
  MjpegWriter& operator=(const MjpegWriter&) = delete;

  // Writes the next frame, RGB of the writer's size, at its time by the rate.
  void add(const lf::Image& rgb) { add(rgb, rate_.time(frames_)); }
  // Writes a frame at `time`, nanoseconds from the beginning on, later than the one before. Without a rate the
  // beginning is one that all films have in common, even if no frame was taken then.
  void add(const lf::Image& rgb, GstClockTime time);
  void add_jpeg(GstBuffer* jpeg, GstClockTime time);  // the buffer is borrowed
  void finish();

 private:
  void open(const std::string& coder, GstCaps* caps);  // takes the caps
  void write_beginning();
  void push(GstBuffer* buffer, GstClockTime time);  // takes it
  void close();
  [[noreturn]] void fail();  // throws lf::Error with what the pipeline has to say

  std::string path_;
  lf::FileReplacement file_;
  FrameRate rate_;
  uint64_t frames_ = 0;
  GstElement* pipeline_ = nullptr;
  GstElement* source_ = nullptr;
};
