// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "focus/moments.h"

namespace lf {

// Gains of cameras, added up with the weight that each has in a mean of luma, less for those that are hardly as bright
// as they should be, so that most cameras decide what that is: in logarithms, so that their mean is that of what they
// multiply.
struct GainSum {
  static constexpr int kWeightOne = 65536, kOctave = 256;  // gain 2
  uint32_t weight = 0;
  int32_t log2 = 0;  // weight x logarithm

  void add(float gain, float camera_weight);
  void add(const GainSum& other);
  float mean() const;  // geometric; 1 of none
  bool operator==(const GainSum&) const = default;
};

// The luma that cameras have in common, which each of them compares its own with: a value for each node, 0 where it is
// not well defined: few cameras see it, they disagree, it changes from node to node, or it is nearly black or white.
// `moments`: of luma divided by the cameras' gains. The mean is what it would be if these had the mean 1, so that they
// do not wander off together.
std::vector<uint8_t> mean_luma(const Moments& moments, const GainSum& gains);

}  // namespace lf
