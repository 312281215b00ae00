// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/maths.h"
#include "rig/rig.h"

namespace lf {

// One light as one camera saw it.
struct Observation {
  uint32_t camera = 0;    // index into Tracks::cameras
  uint32_t position = 0;  // number of the light's or the bar's place, counted from 0
  uint32_t light = 0;     // 0, or 1 for the second light of a bar
  Vec2 pixel{0, 0};       // (0, 0) is the centre of the top-left pixel
  double sigma = 1;       // standard deviation of x and of y, in proportion to those of other observations
};

// What all cameras saw of a light (or of two on a rigid bar) at a sequence of places; or of the features of a still
// scene, where each position is a feature. A plain value.
struct Tracks {
  struct Camera {
    uint32_t id = 0;            // unique
    int width = 0, height = 0;  // pixels
  };
  std::vector<Camera> cameras;
  bool bar = false;     // positions have two lights, always equally far apart
  bool ordered = true;  // positions follow each other in time at one frame each (features do not)
  size_t num_positions = 0;
  std::vector<Observation> observations;
};

// Throws Error ("observations[3]: camera 9 is not one of the 4 cameras") where an index is out of range, a pixel is not
// finite or far outside of its image, a camera's id or an observation comes twice.
void check_tracks(const Tracks& tracks, const std::string& name);

// {"format": "lightfield-tracks", "version": 1, "bar": false, "ordered": true,
//  "cameras": [{"id": 0, "width": 320, "height": 240}, ...],
//  "positions": [{"observations": [[camera id, x, y], ...]}, ...]}
// `bar` (default false): observations are [camera id, x, y, light], light 0 or 1 of a rigid bar. `ordered` (default
// true): one position a frame. A position that nobody saw has an empty list. Pixels: (0, 0) is the centre of the
// top-left one. Throws Error naming the file and the place in it.
Tracks load_tracks(const std::string& path);
Tracks parse_tracks(const std::string& text, const std::string& name);
std::string tracks_to_json(const Tracks& tracks);

// What MultiCamSelfCal (Svoboda, Martinec, Pajdla 2005) reads, in one folder: points.dat (3 rows a camera: u, v, 1; a
// column a position), IdMat.dat (a row a camera: seen or not), Res.dat (a row a camera: width, height) and, where
// lenses are known, *.rad (K11 ... K33, kc1 ... kc4), one a camera in the order of their names. `first_pixel`: the
// centre of the top-left pixel is at (0, 0) in the files of programs that count from 0, and at (1, 1) in Matlab's own.
struct MultiCamSelfCal {
  Tracks tracks;              // cameras have ids from 0
  std::optional<Rig> lenses;  // a rig of the lenses alone: all poses are the same
};
// Throws Error naming the file and the row.
MultiCamSelfCal load_multicamselfcal(const std::string& directory, double first_pixel);

// A light as it was found in a picture.
struct Sight {
  Vec2 pixel{0, 0};       // (0, 0) is the centre of the top-left pixel
  double sigma = 0;       // standard deviation of x and of y, pixels, predicted from the picture's noise
  double brightness = 0;  // above the background, summed over the light's image: compares lights of one camera
};

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
// The other kind of that format: where "positions" has what all cameras saw at the same instant, "frames" of each
// camera have what it saw at its own times.
//
// Nothing where `text` has positions. Throws Error naming the file and the place in it.
std::optional<LightSights> parse_light_sights(const std::string& text, const std::string& name);
std::string light_sights_to_json(const LightSights& sights);

}  // namespace lf
