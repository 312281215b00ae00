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
#include "rig/rig.h"

namespace lf {

// What cameras give, on disk: a folder with one file for each of them and a rig.json whose cameras these files are, for
// lfcameranode to play. A file a camera, because cameras come, fail and come back one by one, and any subset of them
// can be copied and played.
//
// What the disk does not take is dropped and counted, and what ends the recording ends nothing else. Posts a warning
// and the element message LF_RECORDING_STOPPED of `owner`. Thread-safe.
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
  // A frame of the camera with this id, which was taken at `captured`: clock time if it is live, else time in the film.
  void add(uint32_t camera, GstBuffer* frame, GstCaps* caps, GstClockTime captured, bool live);
  // All that was added is in the files, and they are closed; unless the disk hangs for five seconds. No frame is taken
  // any more.
  void finish();

  CameraFile::Counts counts(uint32_t camera) const;
  // The clock time from which live frames count, and why it stopped, "" where it did not.
  GstStructure* stats() const;

 private:
  void save(const Rig& rig, const std::string& rig_file) const;
  GstClockTime begin(GstClockTime captured, bool live);
  void stop(const std::string& reason);
  void tell_dropped(uint32_t camera);

  GstElement* const owner_;
  const std::string folder_;
  std::map<uint32_t, std::unique_ptr<CameraFile>> files_;  // by the camera's id
  std::map<uint32_t, std::string> names_;                  // "camera 3 (cam_00_03)"
  std::atomic<bool> finished_ = false, stopped_ = false, has_dropped_ = false;
  mutable std::mutex mutex_;
  std::optional<GstClockTime> begin_;
  std::string begins_;  // the same as the time of day
  std::string reason_;  // why it stopped
};

}  // namespace lf
