// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <gst/gst.h>

#include "recording/camera_file.h"
#include "rig/rig.h"

namespace lf {

// Converts the capture times of live cameras to times since the start of a recording. Times in a file must increase,
// even if the system clock is set back during the recording. The class then adds an offset, so that the camera
// continues directly after its latest frame. All cameras get the same offset, so that they stay synchronised. Each
// camera changes to the offset when its own frames show the step of the clock, because older frames of other cameras
// may still be on their way. Times are nanoseconds. Not thread-safe.
class CaptureTimeline {
 public:
  // A smaller step back is a frame out of order and not a clock change.
  static constexpr gint64 kSetBack = GST_SECOND;

  // `begin` is the clock time of the start of the recording.
  explicit CaptureTimeline(GstClockTime begin) : begin_(static_cast<gint64>(begin)) {}

  struct Place {
    gint64 time;      // relative to the start; negative: before the start, or an implausible outlier
    gint64 set_back;  // clock step that this frame is the first to show; else 0
  };
  Place place(uint32_t camera, GstClockTime captured);
  GstClockTime begin() const { return static_cast<GstClockTime>(begin_); }

 private:
  struct Camera {
    gint64 offset = 0;
    gint64 newest = 0;
    gint64 period = 0;
    std::optional<gint64> stray;  // capture time of the latest frame if it is far before `newest`
    bool is_seen = false;
  };
  // Returns true if this camera should change to the offset that another camera has introduced. `time` is the time of
  // its new frame with the present offset. The offset is right if the frame then fits better to the frames of other
  // cameras.
  bool belongs_to_latest(gint64 time, const Camera& camera) const;

  gint64 begin_;
  gint64 offset_ = 0;
  gint64 newest_ = 0;
  std::map<uint32_t, Camera> cameras_;
};

// A recording of several cameras: a folder with one file per camera and a rig.json, for playback in lfcameranode.
// Cameras have separate files so that they can fail and return independently, and so that subsets can be copied and
// played.
//
// If the disk is too slow, frames are dropped and counted. If a file cannot be written, only this file ends, with a
// warning from `owner`. A full disk or an unwritable folder ends the recording with the element message
// LF_RECORDING_STOPPED. The thread that adds the next frame reports the error. Thread-safe.
class Recording {
 public:
  // Creates `folder` and its rig.json, a copy of the rig in `rig_file` with other sources. `owner` must outlive the
  // recording. Throws Error if writing fails or the folder contains a recording.
  Recording(GstElement* owner, const std::string& folder, const Rig& rig, const std::string& rig_file,
            const std::vector<CameraIndex>& cameras);
  ~Recording();
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;

  // Replaces the rig in the folder, for example after a calibration.
  void update_rig(const Rig& rig, const std::string& rig_file);
  // Adds a frame of the camera with this id (see CameraFile). `captured` is clock time for live cameras, and otherwise
  // the time in the film.
  void add(uint32_t camera, GstBuffer* frame, GstCaps* caps, GstClockTime captured, bool live);
  // Writes and closes all files. Waits at most five seconds for the disk. Later frames are ignored.
  void finish();

  CameraFile::Counts counts(uint32_t camera) const;
  // Returns a structure with the folder, the clock time of the start, and the reason if the recording has stopped early
  // (otherwise ""). The caller owns the structure.
  GstStructure* stats() const;

 private:
  struct Track {
    std::string name;  // "camera 3 (cam_00_03)"
    std::unique_ptr<CameraFile> file;
    std::atomic<bool> warned_codec = false, reported_failure = false;
  };
  void save(const Rig& rig, const std::string& rig_file) const;
  std::optional<GstClockTime> time_of(uint32_t camera, GstClockTime captured, bool live, bool coded);
  void warn_clock_set_back(gint64 nanoseconds);
  void tell(Track& track, GstCaps* caps, CameraFile::AddResult added);
  void warn_behind(const Track& track);
  void warn_other_codec(Track& track, GstCaps* caps);
  void report_failure(Track& track);
  void stop(const std::string& reason);

  GstElement* const owner_;
  const std::string folder_;
  std::map<uint32_t, Track> tracks_;
  std::atomic<size_t> failed_ = 0;
  std::atomic<bool> finished_ = false, stopped_ = false, warned_behind_ = false, warned_set_back_ = false;
  mutable std::mutex mutex_;
  std::optional<CaptureTimeline> timeline_;
  std::string begins_;
  std::string reason_;
};

}  // namespace lf
