// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calibration/light_detector.h"

namespace lf {

// What each camera saw of a moving light, or of the two of a bar, by its own clock: frames that no other camera took at
// the same instant, lights beside their reflections. A plain value.
struct LightSights {
  struct Frame {
    double time = 0;            // the camera's own stamp, seconds; grows from frame to frame
    std::vector<Sight> sights;  // brightest first; may be empty
  };
  struct Camera {
    uint32_t id = 0;            // unique
    int width = 0, height = 0;  // pixels
    std::vector<Frame> frames;
  };
  std::vector<Camera> cameras;
  bool bar = false;  // two lights, always equally far apart
};

// {"format": "lightfield-tracks", "version": 1, "bar": true, "cameras": [{"id": 0, "width": 320, "height": 240,
//  "frames": [[seconds, [x, y, sigma, brightness], ...], ...]}, ...]}
// The other kind of the format of tracks.h: where "positions" has what cameras saw at the same instant, "frames" of
// each camera have what it saw at its own times.
//
// Nothing where `text` has positions. Throws Error naming the file and the place in it.
std::optional<LightSights> parse_light_sights(const std::string& text, const std::string& name);
std::string light_sights_to_json(const LightSights& sights);

}  // namespace lf
