// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/maths.h"
#include "calibration/tracks.h"
#include "image/image.h"
#include "rig/rig.h"

namespace lf {

// The luma of an RGB image as a smooth function of the place: the cubic B-spline through its pixels (Unser, "Splines: a
// perfect fit for signal and image processing", 1999). Bilinear interpolation is blunter half-way between pixels than
// on them, which pulls what is located by it towards them by hundredths of a pixel.
class SplineImage {
 public:
  explicit SplineImage(const Image& rgb);

  // Whether the four pixels to each side that a sample needs are there.
  bool has(double x, double y) const { return x >= 1 && y >= 1 && x < width_ - 2 && y < height_ - 2; }
  // The value at a place, for which has(x, y).
  float value(double x, double y) const;
  struct Sample {
    float value, dx, dy;
  };
  Sample sample(double x, double y) const;

 private:
  int width_, height_;
  std::vector<float> coefficients_;
};

// What surrounds a point of one image, to be found again in others to a few hundredths of a pixel. The patch may be
// stretched, sheared and turned there (a slanted surface, another part of the lens), brighter and of another contrast:
// matched without these, the middle of what it shows would be found instead of the point, off by as much as the two
// differ, and in the same way in all images. Pixels near the point count more (a Gaussian).
class Patch {
 public:
  // Nothing where the image ends, or has too little in it to tell the point's place and the warp.
  static std::optional<Patch> cut(const SplineImage& image, const Vec2& point);

  struct Match {
    Vec2 point;
    double correlation = 0;  // correlation of the patch with what is seen there; 1: the same
  };
  // Finds the patch near `guess` (within 2 pixels) by inverse compositional Gauss-Newton steps (Baker and Matthews,
  // "Lucas-Kanade 20 years on", 2004). Nothing where these leave the image, or go astray.
  std::optional<Match> find(const SplineImage& image, const Vec2& guess) const;

 private:
  static constexpr int kRadius = 9, kSize = (2 * kRadius + 1) * (2 * kRadius + 1);
  static constexpr int kTerms = 6;  // a shift and a linear warp
  using Values = Eigen::Matrix<float, kSize, 1>;

  Patch() = default;
  static const Values& weights();
  // Brings values to zero mean and unit variance; false where all of them is noise.
  static bool normalise(Values& values);

  Values values_;
  Eigen::Matrix<float, kTerms, kSize> step_;  // what takes differences of values to steps of the terms
};

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
// surroundings stretched and sheared as they appear there (Patch). Of the rig, only the cameras' order in space is
// used: the nominal layout will do. Neighbours may be about 50 pixels apart (for images of 320x240; more for larger
// ones).
//
// `images` are RGB, one a camera. The result is not `ordered`. Throws Error where there are too few tracks to be of
// use.
Tracks track_features(const Rig& rig, const std::vector<Image>& images, const FeatureOptions& options = {});

}  // namespace lf
