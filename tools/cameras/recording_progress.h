// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdio>
#include <optional>
#include <string>

#include "progress.h"
#include "timed_progress.h"

namespace lf::cameras {

// Tells people what record_cameras() is doing, and when to begin with what is to be seen.
class RecordingProgress {
 public:
  // As record_cameras() calls it.
  void tell(double share) {
    if (share < 0) {
      if (!opening_) opening_.emplace("opening cameras", 3);
      return;
    }
    if (!recording_) {
      opening_.reset();
      std::printf("Recording now.\n");
      std::fflush(stdout);
      recording_.emplace("recording", 0);
    }
    recording_->reach(share);
  }
  // A line for the person before the cameras, above the bar.
  void say(const std::string& line) {
    if (recording_) recording_->finish();
    std::printf("%s\n", line.c_str());
    std::fflush(stdout);
  }

 private:
  std::optional<TimedProgress> opening_;
  std::optional<Progress> recording_;
};

}  // namespace lf::cameras
