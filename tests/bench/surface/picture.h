// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "image/image.h"
#include "quality/quality.h"

namespace lf::focus {

// One picture and what it cost. Bytes and times are of one picture.
struct Picture {
  Image image;
  std::vector<float> coverage;
  Quality quality;
  double colour_bytes = 0, trial_bytes = 0;  // 16-bit sums of the whole array, and moments
  double colour_ms = 0, trial_ms = 0;        // by one thread; images are there already
};

}  // namespace lf::focus
