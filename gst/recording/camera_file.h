// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/app/app.h>
#include <gst/gst.h>

#include <cstdint>
#include <mutex>
#include <string>

#include "rig/rig.h"

namespace lf {

// The Matroska file of one camera in a recording. Each frame has the time at which it was taken, counted from the
// recording's beginning, and lasts until the next one. Thread-safe; nothing here waits for the disk.
class CameraFile {
 public:
  struct Counts {
    uint64_t frames = 0;   // given to the file
    uint64_t dropped = 0;  // not: the disk, or the encoder, is behind
  };

  // `pipeline`: the recording's, which plays; the elements are put into it with the first frame. `most_bytes`: what may
  // wait for the disk; four frames always may.
  CameraFile(GstBin* pipeline, const Camera& camera, const std::string& path, guint64 most_bytes);
  ~CameraFile();
  CameraFile(const CameraFile&) = delete;
  CameraFile& operator=(const CameraFile&) = delete;

  // A frame of JPEG or raw video, which stays the caller's. Frames that are no later than one before are left out.
  // `begins`: in words, when the recording began. False if the frame was dropped. Throws Error where an element is not
  // installed.
  bool add(GstBuffer* frame, GstCaps* caps, GstClockTime time, const std::string& begins);
  // Where the newest frame would end that lasts as long as the one before it; 0 without frames.
  GstClockTime ends_at() const;
  // The newest frame lasts until `time`, and none follows.
  void end(GstClockTime time);

  Counts counts() const;
  const std::string& path() const { return path_; }

 private:
  void build(bool jpeg, const std::string& begins);
  GstElement* add_element(const char* factory);
  GstElement* add_source(GstCaps* caps);
  bool is_behind(GstBuffer* frame) const;
  void push_held(GstClockTime until);

  GstBin* const pipeline_;
  const int width_, height_;
  const std::string path_;
  const guint64 most_bytes_;
  mutable std::mutex mutex_;
  GstAppSrc* source_ = nullptr;  // borrowed from the pipeline; null before the first frame
  bool is_jpeg_ = false, ended_ = false;
  GstBuffer* held_ = nullptr;  // the newest frame, which lasts until the next one
  GstClockTime period_ = 0;    // between the latest two
  Counts counts_;
};

}  // namespace lf
