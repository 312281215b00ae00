// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "calibration/tracks.h"

namespace lf {

// {"format": "lightfield-tracks", "version": 1, "bar": false, "ordered": true,
//  "cameras": [{"id": 0, "width": 320, "height": 240}, ...],
//  "positions": [{"observations": [[camera id, x, y], ...]}, ...]}
// `bar` (default false): observations are [camera id, x, y, light], light 0 or 1 of a rigid bar. `ordered` (default
// true): one position a frame. A position that nobody saw has an empty list. Pixels: (0, 0) is the centre of the
// top-left one. Throws Error naming the file and the place in it.
Tracks load_tracks(const std::string& path);
Tracks parse_tracks(const std::string& text, const std::string& name);
std::string tracks_to_json(const Tracks& tracks);

}  // namespace lf
