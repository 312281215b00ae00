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

// Where in a recording the frames of live cameras belong, which are dated by a clock that may be set back. A camera
// then goes on right behind what it has given before, and the others by the same offset, so that all stay in step; each
// when its own frames show it, as some of before are still on their way. Times in nanoseconds. Not thread-safe.
class CaptureTimeline {
 public:
  // Frames that are out of order by less are no sign of a clock that was set back.
  static constexpr gint64 kSetBack = GST_SECOND;

  // `begin`: the clock's time where the recording begins.
  explicit CaptureTimeline(GstClockTime begin) : begin_(static_cast<gint64>(begin)) {}

  struct Place {
    gint64 time;      // counted from the beginning; negative: taken before it; of what has strayed far too early
    gint64 set_back;  // by how much the clock was, as this frame is the first one to show; else 0
  };
  Place place(uint32_t camera, GstClockTime captured);
  GstClockTime begin() const { return static_cast<GstClockTime>(begin_); }

 private:
  struct Camera {
    gint64 offset = 0;            // of its times, for what the clock was set back by
    gint64 newest = 0;            // its latest frame's time
    gint64 period = 0;            // between its latest two
    std::optional<gint64> stray;  // when the latest frame was taken, if that is long before `newest`
    bool is_seen = false;
  };
  // Whether a frame that would be at `time` is nearer to the others by the latest offset.
  bool belongs_to_latest(gint64 time, const Camera& camera) const;

  gint64 begin_;
  gint64 offset_ = 0;  // the latest one
  gint64 newest_ = 0;  // of all cameras
  std::map<uint32_t, Camera> cameras_;
};

// What cameras give, on disk: a folder with one file for each of them and a rig.json whose cameras these files are, for
// lfcameranode to play. A file a camera, because cameras come, fail and come back one by one, and any subset of them
// can be copied and played.
//
// What the disk does not take is dropped and counted. A file that can't be written any more ends for itself, with a
// warning of `owner`; a full disk, or a folder that can't be written to, ends the recording, with the element message
// LF_RECORDING_STOPPED as well, and nothing else. It is told with the next frame, by the thread that brings it.
// Thread-safe.
class Recording {
 public:
  // Makes `folder` with its rig.json, of the rig that was read from `rig_file`; `owner` outlives this. Throws Error
  // where that can't be written, or there is a recording in it already.
  Recording(GstElement* owner, const std::string& folder, const Rig& rig, const std::string& rig_file,
            const std::vector<CameraIndex>& cameras);
  ~Recording();  // finishes
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;

  // The rig has been measured anew: the files are played with it.
  void take_rig(const Rig& rig, const std::string& rig_file);
  // A frame of the camera with this id (see CameraFile), which was taken at `captured`: clock time if it is live, else
  // time in the film.
  void add(uint32_t camera, GstBuffer* frame, GstCaps* caps, GstClockTime captured, bool live);
  // All that was added is in the files, and they are closed; unless the disk hangs for five seconds. No frame is taken
  // any more.
  void finish();

  CameraFile::Counts counts(uint32_t camera) const;
  // The clock time from which live frames count, and why it stopped, "" where it did not.
  GstStructure* stats() const;

 private:
  // What is recorded of one camera.
  struct Track {
    std::string name;  // "camera 3 (cam_00_03)"
    std::unique_ptr<CameraFile> file;
    std::atomic<bool> has_told_kind = false, has_told_failed = false;
  };
  void save(const Rig& rig, const std::string& rig_file) const;
  std::optional<GstClockTime> time_of(uint32_t camera, GstClockTime captured, bool live, bool coded);
  void tell_set_back(gint64 nanoseconds);
  void tell(Track& track, GstCaps* caps, CameraFile::Added added);
  void tell_behind(const Track& track);
  void tell_other_kind(Track& track, GstCaps* caps);
  void tell_failed(Track& track);
  void stop(const std::string& reason);

  GstElement* const owner_;
  const std::string folder_;
  std::map<uint32_t, Track> tracks_;  // by the camera's id
  std::atomic<size_t> failed_ = 0;    // of these
  std::atomic<bool> finished_ = false, stopped_ = false, has_told_behind_ = false, has_told_set_back_ = false;
  mutable std::mutex mutex_;
  std::optional<CaptureTimeline> timeline_;  // from the first frame on
  std::string begins_;                       // its beginning as the time of day
  std::string reason_;                       // why it stopped
};

}  // namespace lf
