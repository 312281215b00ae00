// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cmath>

#include "calibration/simulator.h"

namespace lf::sim {

// Errors against the truth and against what is possible at best: of one run, or summed over runs. The bound is that of
// the model which was chosen, with what it takes lenses to be before it sees anything: the prior, or how alike the
// lenses of a batch are.
struct Errors {
  enum Quantity { kPosition, kRotation, kFocal, kTransfer, kNumQuantities };
  std::array<double, kNumQuantities> squared{}, bound{};  // of cameras; of transfers, pixels
  std::array<double, kTransfer> inside{};                 // cameras in the ellipsoids of 95 %
  double cameras = 0, transfers = 0;
  int converged = 0, runs = 0;
  double seconds = 0;  // the slowest

  Errors& operator+=(const Errors& other);
  double ratio(Quantity q) const { return std::sqrt(squared[q] / bound[q]); }
  double share_inside(Quantity q) const { return inside[q] / cameras; }
  double rms(Quantity q) const { return std::sqrt(squared[q] / (q == kTransfer ? transfers : cameras)); }
};

struct Study {
  ArrayOptions array;
  PathOptions path;
  bool prior = true;  // lenses measured before
  std::optional<DistortionModel> distortion;
};

// One seed: makes the array and its tracks, solves them, aligns and compares.
Errors run_seed(const Study& study, uint64_t seed);

}  // namespace lf::sim
