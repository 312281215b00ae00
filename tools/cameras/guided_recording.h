// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "calibration/light_detector.h"
#include "cameras/recorder.h"
#include "cameras/rig_cameras.h"

namespace lf::cameras {

// Finds the image regions that a moved light has not reached yet, during the recording for a calibration, so that the
// person who moves the light knows where to go next. One thread of low priority examines a few downscaled frames per
// second of each camera, so that the recording loses no frames.
class LightTracker {
 public:
  LightTracker(const Rig& rig, int lights);
  LightTracker(const LightTracker&) = delete;
  ~LightTracker();

  // Copies a frame for detection. Thread-safe; call on the thread that delivers the frame.
  void see(const CameraFrame& frame);

  // Return the progress as text for the person, the regions that the light has reached in the image of a camera, and a
  // text with the missing regions of a camera.
  std::string summary() const;
  CoverageGrid places(CameraIndex camera) const;
  std::string wanted(CameraIndex camera) const;
  double busy() const { return busy_; }
  uint64_t frames_processed() const { return frames_processed_; }

 private:
  struct CameraState;
  void work(const std::stop_token& stop);
  void process_frame(CameraIndex camera);

  Rig rig_;
  std::vector<std::unique_ptr<CameraState>> all_;
  mutable std::mutex mutex_;  // guards coverage_ and waiting_
  LightCoverage coverage_;
  std::condition_variable_any frame_arrived_;
  std::vector<CameraIndex> waiting_;
  std::atomic<double> busy_ = 0;
  std::atomic<uint64_t> frames_processed_ = 0;
  std::jthread thread_;  // the last member, so that it ends first
};

struct RecordingGuide {
  // Number of moving lights. Missing image regions are announced every few seconds. 0: nothing is tracked.
  int lights = 0;
  std::vector<std::string> prompts;  // instructions, shown one after another and evenly spread over the recording
  // Port of a local web page with camera images and instructions. 0: any free port; nullopt: no page.
  std::optional<int> page;
};

// Records like record_cameras(), shows the progress on the terminal, and prompts the person. The recording stops and
// keeps its result when `going` returns false. Throws Error as record_cameras() does, and also if the port of the page
// is in use.
std::vector<RecordedCamera> record_guided(std::shared_ptr<const Rig> rig, const std::string& path,
                                          const std::string& folder, RecordingOptions options,
                                          const RecordingGuide& guide, const std::function<bool()>& going);

// Returns instructions for a person who shows a checkerboard to all cameras: positions and tilts that together
// determine the lenses.
std::vector<std::string> board_prompts();

}  // namespace lf::cameras
