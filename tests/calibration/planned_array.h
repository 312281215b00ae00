// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "rig/rig.h"
#include "scene/colour_faults.h"

namespace lf::sim {

// A grid of cameras 6 cm apart that came out otherwise than it was planned, and that runs freely: pointing off by a
// degree, positions by a twentieth of the pitch, focal lengths by 2 %, k1 = -0.15, clocks by up to 20 ms; cameras film
// at 30 and 15 frames a second in turn, with colours of their own, and the last one's exposure is stuck.
struct PlannedArray {
  PlannedArray(int rows, int columns, int width, int height);

  static constexpr int kFaultSeed = 7;  // for lf-scene --faults

  CameraIndex stuck() const { return static_cast<CameraIndex>(truth.cameras.size() - 1); }
  static double rate_of(CameraIndex camera) { return camera % 2 ? 15 : 30; }
  // Root mean square of `rig`'s time offsets less the true ones, less what all have in common; seconds.
  double clock_error(const Rig& rig) const;

  // PSNR of what the array shows of the built-in scene, through a focal surface, where it is taken for `rig`, of each
  // of a few eyes amid the array. Each camera gives the frame that is nearest to one instant by the rig's offsets, with
  // its faults; the rig's colours are corrected, and `rig` is laid over the truth by the similarity that fits best.
  std::vector<double> shown_db(const Rig& rig) const;
  // The truth with the colours of `rig`, since there are no true ones beside those of a mean camera.
  Rig truth_with_colours_of(const Rig& rig) const;

  Rig nominal, truth;
  std::vector<ColourFault> faults;
};

}  // namespace lf::sim
