// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <atomic>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "recording/camera_file.h"
#include "recording/capture_timeline.h"
#include "rig/rig.h"

namespace lf {

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
