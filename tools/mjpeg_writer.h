// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include <gst/gst.h>

#include "base/file.h"
#include "image/image.h"

// A frame rate in frames per second. time(n) is the timestamp of frame n in nanoseconds.
struct FrameRate {
  int numerator = 15, denominator = 1;
  GstClockTime time(uint64_t n) const {
    return gst_util_uint64_scale(n, GST_SECOND * static_cast<guint64>(denominator), static_cast<guint64>(numerator));
  }
};

// Writes a Motion JPEG film into a Matroska file, through a GStreamer pipeline. The file appears when finish()
// succeeds. If finish() is not called, an existing file of this name stays unchanged. Requires gst_init() and is not
// thread-safe. Throws lf::Error that names the file.
class MjpegWriter {
 public:
  // Creates a writer that encodes RGB images with this JPEG quality (1 to 100). A `rate` of 0/1 means that the film has
  // no frame rate, so add() needs a time for every frame.
  MjpegWriter(const std::string& path, int width, int height, FrameRate rate, int quality);
  // Creates a writer for frames that are already JPEG. They are stored without loss by re-encoding.
  MjpegWriter(const std::string& path, int width, int height);
  ~MjpegWriter();
  MjpegWriter(const MjpegWriter&) = delete;
  MjpegWriter& operator=(const MjpegWriter&) = delete;

  void add(const lf::Image& rgb) { add(rgb, rate_.time(frames_)); }
  // Writes a frame at `time` (nanoseconds), which must increase from frame to frame. Films without a rate begin at time
  // 0 even if their first frame is later, so all films of a recording share one time axis.
  void add(const lf::Image& rgb, GstClockTime time);
  void add_jpeg(GstBuffer* jpeg, GstClockTime time);  // `jpeg` is borrowed
  void finish();

 private:
  void open(const std::string& coder, GstCaps* caps);  // takes ownership of `caps`
  void write_beginning();
  void push(GstBuffer* buffer, GstClockTime time);  // takes ownership of `buffer`
  void close();
  [[noreturn]] void fail();

  std::string path_;
  lf::AtomicFileWriter file_;
  FrameRate rate_;
  uint64_t frames_ = 0;
  GstElement* pipeline_ = nullptr;
  GstElement* source_ = nullptr;
};
