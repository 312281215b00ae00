// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cameras/recorder.h"

namespace lf::cameras {

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
