// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "calibration/tracks.h"
#include "image/image.h"
#include "rig/rig.h"

namespace lf {

struct FeatureOptions {
  int references = 16;      // cameras whose corners are followed into all others, spread over the array
  int features = 400;       // corners a reference camera
  int least_cameras = 4;    // cameras that have to see a track
  double round_trip = 0.3;  // pixels: how far a corner may come back from where it started
  double epipolar = 1;      // pixels: how far a corner may lie from what a pair of cameras agrees on
  std::function<void(const std::string& step)> progress;  // called before each reference; may throw to cancel
};

// Tracks of a still scene's corners through the images of an array: for arrays that one can't darken a room for.
//
// A corner is always matched with its reference image, so that errors do not add up from camera to camera; where it
// should be is foretold from the cameras nearer to the reference. It is found by optical flow, then placed with its
// surroundings stretched and sheared as they appear there (patch.h). Of the rig, only the cameras' order in space is
// used: the nominal layout will do. Neighbours may be about 50 pixels apart (for images of 320x240; more for larger
// ones).
//
// `images` are RGB, one a camera. The result is not `ordered`. Throws Error where there are too few tracks to be of
// use.
Tracks track_features(const Rig& rig, const std::vector<Image>& images, const FeatureOptions& options = {});

}  // namespace lf
