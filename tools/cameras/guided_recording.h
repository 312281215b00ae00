// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "calibration/light_detector.h"
#include "cameras/recorder.h"
#include "cameras/rig_cameras.h"

namespace lf::cameras {

// Follows the light that somebody moves before cameras, while they film it: where it has come to, and where it is to
// go. A few frames a second of each camera are looked at, in small, by one thread that gives way to all others, so
// that no film loses a frame for it.
class LightWatch {
 public:
  // `lights`: how many are moved.
  LightWatch(const Rig& rig, int lights);
  ~LightWatch();
  LightWatch(const LightWatch&) = delete;

  // A frame, in the thread that brings it, which is kept for as long as copying takes. Any threads.
  void see(const CameraFrame& frame);

  std::string told() const;  // LightCoverage::told()
  PicturePlaces places(CameraIndex camera) const;
  std::string wanted(CameraIndex camera) const;
  double busy() const { return busy_; }  // seconds of the processor that all looks took
  uint64_t looks() const { return looks_; }

 private:
  struct One;
  void work();
  void look(CameraIndex camera);

  Rig rig_;
  std::vector<std::unique_ptr<One>> all_;  // by index in the rig
  mutable std::mutex mutex_;               // guards what follows
  LightCoverage coverage_;
  std::condition_variable come_;
  std::vector<CameraIndex> waiting_;  // cameras with a frame that was not looked at
  bool ending_ = false;
  std::atomic<double> busy_ = 0;
  std::atomic<uint64_t> looks_ = 0;
  std::thread thread_;
};

// What the person before the cameras is told while they record.
struct RecordingGuide {
  int lights = 0;                    // that are moved: every few seconds, where they are to go next; 0: none
  std::vector<std::string> prompts;  // said one after the other, evenly over the recording
  std::optional<int> page;           // port of a page on this machine that shows the cameras and all this, 0: any
};

// record_cameras() with its progress on the terminal. `going` says whether to go on. Throws Error for what
// record_cameras() throws for, and where the page's port is taken.
std::vector<Recorded> record_guided(std::shared_ptr<const Rig> rig, const std::string& path, const std::string& folder,
                                    RecordingOptions options, const RecordingGuide& guide,
                                    const std::function<bool()>& going);

// For a checkerboard that all cameras film together: where to hold it, and how tilted, until lenses are known.
std::vector<std::string> board_prompts();

}  // namespace lf::cameras
