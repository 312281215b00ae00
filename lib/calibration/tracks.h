// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <lightfield/calibration.h>

#include "base/maths.h"
#include "rig/rig.h"

namespace lf {

struct Observation {
  uint32_t camera = 0;    // index into Tracks::cameras
  uint32_t position = 0;  // number of the light's or bar's position, from 0
  uint32_t light = 0;     // light on the bar (0 or 1), or corner of the board; 0 for single lights
  Vec2 pixel{0, 0};       // (0, 0) is the centre of the top-left pixel
  double sigma = 1;       // standard deviation of x and y; only the ratio to other observations matters
};

// Observations of a light, of two lights on a rigid bar, or of the corners of a calibration board, that moves through a
// sequence of positions. For features of a static scene, each feature is a position. Copyable.
struct Tracks {
  using Camera = lightfield::Tracks::Camera;
  std::vector<Camera> cameras;
  bool bar = false;     // true: each position has two lights at a constant distance
  bool ordered = true;  // true: one position per frame, in the order of time; false: features
  size_t num_positions = 0;
  std::vector<Observation> observations;
  // Corners of the board in its own axes, around its middle, in metres. Empty unless the target is a board. Files of
  // tracks have no boards.
  std::vector<Vec3> board;

  // True if the target has a known shape, so that its size determines the scale of the scene.
  bool rigid_targets() const { return bar || !board.empty(); }
};

// Checks tracks that come from a file or from an application. Throws Error if an index is out of range, a pixel is not
// finite or far outside the image, or a camera id or an observation occurs twice. `name` is the start of the error
// text. Example: "observations[3]: camera 9 is not one of the 4 cameras".
void check_tracks(const Tracks& tracks, const std::string& name);

// File format of tracks:
// {"format": "lightfield-tracks", "version": 1, "bar": false, "ordered": true,
//  "cameras": [{"id": 0, "width": 320, "height": 240}, ...],
//  "positions": [{"observations": [[camera id, x, y], ...]}, ...]}
// `bar` (default false): observations are [camera id, x, y, light], with light 0 or 1. `ordered` (default true): one
// position per frame. Positions without observations have an empty list. Pixel (0, 0) is the centre of the top-left
// pixel. Throws Error with the file name and the place in the file.
Tracks load_tracks(const std::string& path);
Tracks parse_tracks(const std::string& text, const std::string& name);
std::string tracks_to_json(const Tracks& tracks);

// Reads the input files of MultiCamSelfCal (Svoboda, Martinec, Pajdla 2005) from one folder:
//   points.dat  three rows per camera (u, v, 1) and one column per position
//   IdMat.dat   one row per camera: visible or not
//   Res.dat     one row per camera: width and height
//   *.rad       optional; K11 ... K33 and kc1 ... kc4 of each camera, in the order of the file names
// `first_pixel` is the coordinate of the centre of the top-left pixel: 0, or 1 in files written by Matlab.
struct MultiCamSelfCal {
  Tracks tracks;              // cameras have ids from 0
  std::optional<Rig> lenses;  // only the lenses are valid; all poses are equal
};
// Reads these files from one folder. Throws Error with the file and the row.
MultiCamSelfCal load_multicamselfcal(const std::string& directory, double first_pixel);

struct LightDetection {
  Vec2 pixel{0, 0};       // (0, 0) is the centre of the top-left pixel
  double sigma = 0;       // standard deviation of x and y, predicted from the image noise, pixels
  double brightness = 0;  // sum over the light's image above the background; only comparable within a camera
};

// Detections of a moving light, or of two lights on a bar, in the frames of each camera. The frames of different
// cameras are not synchronous, and detections include reflections. Copyable.
struct LightDetections {
  struct Frame {
    double time = 0;                     // camera stamp, seconds; increasing
    std::vector<LightDetection> sights;  // brightest first; may be empty
  };
  struct Camera {
    uint32_t id = 0;
    int width = 0, height = 0;  // pixels
    std::vector<Frame> frames;
  };
  std::vector<Camera> cameras;
  bool bar = false;
};

// The variant of the tracks format for detections. Each camera has "frames" with its own stamps, instead of "positions"
// at common instants:
// {"format": "lightfield-tracks", "version": 1, "bar": true, "cameras": [{"id": 0, "width": 320, "height": 240,
//  "frames": [[seconds, [x, y, sigma, brightness], ...], ...]}, ...]}
//
// Returns nullopt if `text` has positions. Throws Error with the file name and the place in the file.
std::optional<LightDetections> parse_light_detections(const std::string& text, const std::string& name);
std::string light_detections_to_json(const LightDetections& sights);

}  // namespace lf
