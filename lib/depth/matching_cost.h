// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "depth/matching_image.h"

namespace lf {

// Compares an image with the images of neighbouring cameras at hypothetical depths. The cost of a depth is
// the difference of luma and gradients, in levels of luma, 0 to kMax. Differences are truncated to limit the influence
// of reflections. The cost is the mean over the better half of the neighbours, because an object may hide the point
// from the other half.
//
// Costs are bit-identical with every instruction set. Not thread-safe.
class MatchingCost {
 public:
  static constexpr float kMaxLuma = 10, kMaxGradient = 4;  // truncation: levels, and levels per pixel
  static constexpr float kMax = 0.5f * kMaxLuma + 0.5f * 2 * kMaxGradient;

  // The images must outlive the object. There must be at least one neighbour.
  MatchingCost(const MatchingImage& image, std::span<const MatchingImage* const> neighbours);

  // Writes the cost of an inverse depth (1/m) for each pixel. Both spans have a value per pixel of the image. A
  // neighbour that does not see the point has the cost kMax.
  void compute(std::span<const float> inverse, std::span<float> cost);

 private:
  struct Neighbour {
    const MatchingImage* image;
    PixelMapping mapping;
  };

  const MatchingImage& image_;
  std::vector<Neighbour> neighbours_;
  std::vector<int32_t> place_, across_, down_;  // of a row in a neighbour's image
  std::vector<float> cost_;
  std::vector<std::vector<float>> least_;  // of each pixel in a row, ascending
};

}  // namespace lf
