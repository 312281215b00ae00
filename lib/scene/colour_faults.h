// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "base/vec.h"
#include "image/image.h"
#include "rig/rig.h"

namespace lf {

// What a camera makes of the picture that a camera without faults takes: light goes through its lens and its colour
// filters, is exposed, encoded, and has noise.
struct ColourFault {
  double gain = 1;        // factor of levels: the light's to the power of 1 / `gamma`
  Vec3 balance{1, 1, 1};  // gains of the channels, beside `gain`
  Vec3 black{0, 0, 0};    // levels without light
  double gamma = 2;       // encodes light with 1 / gamma; the scene has 2
  std::array<double, 9> crosstalk{1, 0, 0, 0, 1, 0, 0, 0, 1};  // matrix of light, row by row; rows sum to 1
  std::array<double, 2> vignetting{0, 0};                      // share of the light: see ColourModel
  double noise = 0;                                            // standard deviation, levels
};

// How far faults of cameras go: uniform between plus and minus of each.
struct ColourFaultOptions {
  double gain = 0.08, balance = 0.05;  // parts of levels
  double black = 4;                    // levels; all cameras have as many more
  double gamma = 0.03;                 // part of the exponent
  double crosstalk = 0.03;             // part of light that goes from one channel into another: from 0 up
  double vignetting = 0.3;             // part of light lost half a diagonal from the middle: from half of this up
  double noise = 3;                    // levels
};

// Faults for as many cameras: the same for the same seed on every machine.
std::vector<ColourFault> random_faults(size_t cameras, uint32_t seed, const ColourFaultOptions& options = {});
// An exposure that is stuck: levels are so many times as high.
inline constexpr double kStuckGain = 1.6;

// An RGB image of the scene as the camera gives it. `seed`: of its noise.
Image with_fault(const Image& rgb, const ColourFault& fault, const Vec2& principal_point, uint64_t seed);

// {"format": "lightfield-colour-faults", "version": 1, "cameras": [{"id", "gain", "balance", ...}]}: the truth about a
// film.
std::string faults_to_json(const Rig& rig, const std::vector<ColourFault>& faults);

}  // namespace lf
