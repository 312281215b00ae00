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

// The luma of an RGB image as a cubic B-spline through its pixels (Unser, "Splines: a perfect fit for signal and image
// processing", 1999).
class SplineImage {
 public:
  explicit SplineImage(const Image& rgb);

  // True if all pixels that a sample at this position needs are inside the image.
  bool has(double x, double y) const { return x >= 1 && y >= 1 && x < width_ - 2 && y < height_ - 2; }
  float value(double x, double y) const;
  struct Sample {
    float value, dx, dy;
  };
  Sample sample(double x, double y) const;

 private:
  int width_, height_;
  std::vector<float> coefficients_;
};

// The surroundings of a point in one image. The search also estimates an affine warp (for slanted surfaces and lens
// distortion), brightness and contrast; otherwise the position would be biased in the same way in all images. Pixels
// near the point have more weight (Gaussian).
class Patch {
 public:
  // Returns nullopt near the border of the image, or if the texture does not determine position and warp.
  static std::optional<Patch> cut(const SplineImage& image, const Vec2& point);

  struct Match {
    Vec2 point;
    double correlation = 0;  // correlation with the image at `point`; 1: identical
  };
  // Finds the patch within 2 pixels of `guess` by inverse compositional Gauss-Newton steps (Baker and Matthews,
  // "Lucas-Kanade 20 years on", 2004). Returns nullopt if the search leaves the image or diverges.
  std::optional<Match> find(const SplineImage& image, const Vec2& guess) const;

 private:
  static constexpr int kRadius = 9, kSize = (2 * kRadius + 1) * (2 * kRadius + 1);
  static constexpr int kTerms = 6;  // translation and linear warp
  using Values = Eigen::Matrix<float, kSize, 1>;

  Patch() = default;
  static const Values& weights();
  // Normalises values to zero mean and unit variance. Returns false if they are only noise.
  static bool normalise(Values& values);

  Values values_;
  Eigen::Matrix<float, kTerms, kSize> step_;  // maps differences of values to a step of the terms
};

struct FeatureOptions {
  // number of cameras, spread over the array, that provide corners
  int references = 16;
  int features = 400;
  int least_cameras = 4;                                  // minimum number of cameras in a track
  std::function<void(const std::string& step)> progress;  // called before each reference; may throw to cancel
};

// Tracks corners of a static scene through the images of an array, as input for a calibration in rooms that cannot be
// darkened.
//
// Each corner is matched with its reference image, so that errors do not accumulate from camera to camera. Cameras that
// are nearer to the reference predict the position, optical flow finds the corner, and Patch refines the position. The
// rig only provides the spatial order of the cameras, so a nominal layout is enough. In images of 320x240, a corner may
// move by about 50 pixels between neighbours, and more in larger images.
//
// `images` are RGB, one per camera. The resulting tracks are not `ordered`. Throws Error if there are too few tracks.
Tracks track_features(const Rig& rig, const std::vector<Image>& images, const FeatureOptions& options = {});

}  // namespace lf
