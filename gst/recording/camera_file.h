// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/app/app.h>
#include <gst/gst.h>

#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "rig/rig.h"

namespace lf {

// The Matroska file of one camera in a recording. Each frame has the time at which it was taken, counted from the
// recording's beginning, and lasts until the next one. A bin of its own writes it, whose troubles are nobody else's.
// Thread-safe; nothing but close() waits for the disk.
class CameraFile {
 public:
  struct Counts {
    uint64_t frames = 0;   // given to the file
    uint64_t dropped = 0;  // not, for one of the reasons that Added has, or left out
  };
  // What became of a frame.
  enum class Added {
    kTaken,
    kBehind,     // the disk, or the encoder, is
    kOtherKind,  // a file has JPEG as it came, or encoded raw video
    kNoLater,    // than one before
    kFailed,     // nothing more can be written, see problem()
  };
  // What has ended the file before its time.
  struct Problem {
    std::string text;
    bool disk_is_full = false;
  };

  // `most_bytes`: what may wait for the disk; four frames always may.
  CameraFile(const Camera& camera, const std::string& path, guint64 most_bytes);
  ~CameraFile();
  CameraFile(const CameraFile&) = delete;
  CameraFile& operator=(const CameraFile&) = delete;

  // A frame of JPEG or raw video, which stays the caller's. `begins`: in words, when the recording began.
  Added add(GstBuffer* frame, GstCaps* caps, GstClockTime time, const std::string& begins);
  // A frame is dropped that was never for the file.
  void leave_out();
  // Where the newest frame would end that lasts as long as the one before it; 0 without frames.
  GstClockTime ends_at() const;
  // The newest frame lasts until `time`, and none follows.
  void end(GstClockTime time);
  // Behind end(): waits until all is in the file, up to `deadline` of g_get_monotonic_time(); what is not then goes on
  // by itself for as long as it takes.
  void close(gint64 deadline);

  Counts counts() const;
  std::optional<Problem> problem() const;

 private:
  // What the bin says; it may outlive this.
  struct Outcome {
    ~Outcome() { g_clear_error(&error); }
    std::mutex mutex;
    std::condition_variable changed;
    bool done = false;        // written, or failed
    GError* error = nullptr;  // what failed first
  };
  static GstBusSyncReply on_message(GstBus* bus, GstMessage* message, gpointer outcome);
  void build(GstCaps* caps, const std::string& begins);
  GstElement* add_element(const char* factory);
  GstElement* add_source(GstCaps* caps);
  bool is_behind(GstBuffer* frame) const;
  void push_held(GstClockTime until);
  Added added(GstBuffer* frame, GstCaps* caps, GstClockTime time, const std::string& begins);

  const int width_, height_;
  const std::string path_;
  const guint64 most_bytes_;
  const std::shared_ptr<Outcome> outcome_ = std::make_shared<Outcome>();
  mutable std::mutex mutex_;
  GstElement* bin_ = nullptr;    // null before the first frame
  GstAppSrc* source_ = nullptr;  // borrowed from it
  bool is_jpeg_ = false, ended_ = false;
  GstBuffer* held_ = nullptr;  // the newest frame, which lasts until the next one
  GstClockTime period_ = 0;    // between the latest two
  Counts counts_;
};

}  // namespace lf
