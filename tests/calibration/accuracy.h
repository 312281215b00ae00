// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "calibration/simulator.h"

namespace lf::sim {

// Errors against the truth and against what is possible at best, summed over seeds.
struct Errors {
  enum Quantity { kPosition, kRotation, kFocal, kNumQuantities };
  std::array<double, kNumQuantities> squared{}, bound{},
      inside{};  // squared errors; their Cramer-Rao bounds; ellipsoids
  double cameras = 0;
  double transfer_squared = 0, transfers = 0;  // pixels
  int converged = 0, runs = 0;
  double seconds = 0;  // the slowest

  double ratio(Quantity q) const { return std::sqrt(squared[q] / bound[q]); }
  double share_inside(Quantity q) const { return inside[q] / cameras; }
  double rms(Quantity q) const { return std::sqrt(squared[q] / cameras); }
  double transfer() const { return std::sqrt(transfer_squared / transfers); }
};

struct Study {
  ArrayOptions array;
  PathOptions path;
  bool prior = true;  // lenses measured before
  std::optional<DistortionModel> distortion;
};

// One seed: makes the array and its tracks, solves them, aligns and compares.
void add_run(const Study& study, uint64_t seed, Errors& errors);

}  // namespace lf::sim
