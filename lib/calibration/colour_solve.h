// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "calibration/colour_samples.h"
#include "calibration/report.h"
#include "image/colour_correction.h"

namespace lf {

// The colour parameters that may differ between cameras, in addition to brightness.
struct ColourTerms {
  bool balance = false;  // gains of red and blue relative to green
  bool black = false;
  bool gamma = false;
  bool crosstalk = false;  // matrix between the channels that keeps greys grey
  bool vignetting = false;
  bool operator==(const ColourTerms&) const = default;

  std::string name() const;
};

// How much the colours of corrected cameras differ at common patches, per channel and pair of cameras, in levels.
struct ColourDifferences {
  double median = 0, p95 = 0, rms = 0;
  size_t pairs = 0;
};
// Compares the patches and cameras that are marked (empty: all). The RMS counts larger differences as 12 levels,
// because they have other causes than the colour response.
ColourDifferences colour_differences(const Rig& rig, const ColourSamples& samples,
                                     const std::vector<ColourModel>& models, const std::vector<bool>& patches = {},
                                     const std::vector<bool>& cameras = {});

// Colour models of an array, with only as many parameters as the samples justify.
struct ColourSolution {
  // One model per camera, or nullopt for cameras with too few samples.
  std::vector<std::optional<ColourModel>> models;
  ColourTerms terms;
  // A set of terms that was tested, and the differences that remained on patches left out of the fit.
  struct Trial {
    ColourTerms terms;
    ColourDifferences held_out;
  };
  std::vector<Trial> trials;
  // Differences on the left-out patches without correction, and with the fit to all remaining patches. Cameras with a
  // wrong exposure do not count.
  ColourDifferences before, after;
  struct Camera {
    size_t samples = 0;     // number of samples with a usable channel
    double clipped = 0;     // share of the camera's samples with a clipped channel
    double gain = 1;        // brightness relative to the median camera, from a fit of brightness alone
    double rms = 0;         // RMS difference of the corrected camera from others on left-out patches, in levels
    bool is_stuck = false;  // the exposure is far from the median
  };
  std::vector<Camera> cameras;
  std::vector<Finding> findings;
};

// Fits colour models and decides which terms they need. The decision uses fits without a quarter of the patches.
// Starting with brightness alone, each round adds the term that reduces the differences on the left-out patches most,
// as long as it improves them by at least 3 % and 0.05 levels. The final models are fitted to all patches. Throws Error
// if fewer than two cameras can be compared. Calls `progress` before each step; it may throw to cancel.
ColourSolution solve_colours(const Rig& rig, const ColourSamples& samples,
                             const std::function<void(const std::string& step)>& progress = {});

}  // namespace lf
