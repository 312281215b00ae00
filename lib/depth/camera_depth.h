// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>
#include <vector>

#include "depth/matching_image.h"

namespace lf {

// Depths to search: `planes` inverse depths (1/m), equally spaced from `farthest` to `nearest`.
struct DepthSweep {
  double farthest = 0, nearest = 0;
  int planes = 0;  // at least 2
  double step() const { return (nearest - farthest) / (planes - 1); }
};

// The depth of each pixel of a camera's MatchingImage.
struct CameraDepth {
  std::vector<float> inverse;  // 1/Z, 1/m
  // 0 to 1: the share of neighbouring cameras with the same depth, among those that should see the point. Empty before
  // check_consistency().
  std::vector<float> confidence;
};

// Estimates the depth of each pixel by comparing the image with the images of neighbouring cameras (multi-view stereo).
// First it sweeps planes through the range. Then it refines the depths by propagation from pixel to pixel and by
// smaller steps, as in PatchMatch Stereo (M. Bleyer et al. 2011). The costs (see MatchingCost) are smoothed by a guided
// filter (K. He et al. 2010), which preserves the edges of the image.
//
// Without neighbours, all depths are `range.farthest`. The result does not depend on the number of threads.
CameraDepth estimate_depth(const MatchingImage& image, std::span<const MatchingImage* const> neighbours,
                           const DepthSweep& range);

// Does the same, starting with an estimate of the inverse depth of each pixel. Tests only every `turns`-th plane
// of the range, from number `turn` on, so that `turns` calls with the same image test all planes.
CameraDepth update_depth(const MatchingImage& image, std::span<const MatchingImage* const> neighbours,
                         const DepthSweep& range, const std::vector<float>& before, int turns, int turn);

// Does the same in half of the time, but tests only depths near those around each pixel in `before`.
CameraDepth refine_depth(const MatchingImage& image, std::span<const MatchingImage* const> neighbours,
                         const DepthSweep& range, const std::vector<float>& before);

// Returns the confidence of a camera's depths: see CameraDepth. Depths agree if they differ by less than 1.5 steps of
// the range. A neighbour with a nearer depth does not count, because it may see something in front of the point.
struct DepthNeighbour {
  const MatchingImage* image;
  const CameraDepth* depth;
};
std::vector<float> check_consistency(const MatchingImage& image, const CameraDepth& depth,
                                     std::span<const DepthNeighbour> neighbours, double step);

// Replaces each inverse depth by the median of the 3 x 3 depths around it, unless at least two of these neighbours
// agree with it. A thin object, such as a cord, is a line of single pixels that agree.
std::vector<float> without_outliers(const std::vector<float>& inverse, int width, int height, double step);

}  // namespace lf
