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

// The parameters of colour in which cameras are allowed to differ. Brightness always is one of them.
struct ColourTerms {
  bool balance = false;     // gains of red and blue beside green's
  bool black = false;       // a black level for each channel
  bool gamma = false;       // one exponent for all channels
  bool crosstalk = false;   // a matrix between channels, under which greys stay grey
  bool vignetting = false;  // k1 and k2
  bool operator==(const ColourTerms&) const = default;

  // "brightness, white balance and vignetting".
  std::string name() const;
};

struct ColourFit {
  // One model for each camera; the default for cameras without samples.
  std::vector<ColourModel> models;
  // Logarithm of the light that a camera takes for its own, over that of the mean: 0.69 is an exposure twice as long.
  std::vector<double> log_exposure;
  std::vector<std::array<double, 15>> parameters;  // the parameters of each camera, for another fit to begin with
};

// Fits the parameters of all cameras and the colours of all patches at once: the least squares of what samples are off
// the levels that the model foretells, over their sigma, under a Cauchy loss of 2. Patches of a chart have the same
// colours wherever it was held, but for how bright it was there, and brighter to one side: that tells what lenses take
// away towards their edges. The mean of the cameras' parameters, but for vignetting, is that of a camera without
// faults: the mean correction of the array is none. What the samples leave open besides weak priors settle. `apart`:
// cameras that are no part of that mean, one a camera, may be empty. `patches`: samples of others are left out; empty:
// all count. `start`: of a fit with fewer terms; may be null. Models are sound (fault_of()), where need be by shrinking
// them.
ColourFit fit_colours(const Rig& rig, const ColourSamples& samples, const ColourTerms& terms,
                      const std::vector<bool>& apart = {}, const std::vector<bool>& patches = {},
                      const ColourFit* start = nullptr);

// How far cameras that see the same patch are from each other once they are corrected: differences of a channel of two
// of them, levels.
struct ColourDifferences {
  double median = 0, p95 = 0, rms = 0;
  size_t pairs = 0;
};
// The differences on the patches and between the cameras that are true in the lists (empty: all). Differences of more
// than 12 levels count as 12 in the rms: of such a sample something else is wrong.
ColourDifferences colour_differences(const Rig& rig, const ColourSamples& samples,
                                     const std::vector<ColourModel>& models, const std::vector<bool>& patches = {},
                                     const std::vector<bool>& cameras = {});

// A sample as the model corrects it, with vignetting.
Vec3 corrected_level(const Camera& camera, const ColourModel& model, const ColourSample& sample);

struct ColourSolveOptions {
  std::function<void(const std::string& step)> progress;  // called before each step; may throw to cancel
};

// The colours of an array's cameras, by as few parameters as the samples call for.
struct ColourSolution {
  // One model for each camera; nothing for those of which too little is seen.
  std::vector<std::optional<ColourModel>> models;
  ColourTerms terms;  // the terms that were chosen
  // Terms that were tried, and how far cameras were from each other by them on patches that the fit did not see.
  struct Trial {
    ColourTerms terms;
    ColourDifferences held_out;
  };
  std::vector<Trial> trials;
  // How far cameras differ on the held-out patches: as they give them, and as a fit to the other patches corrects them.
  // Cameras that are stuck are left out.
  ColourDifferences before, after;
  struct Camera {
    size_t samples = 0;     // samples with a channel that can be used
    double clipped = 0;     // share of the camera's samples with a channel that can not be used
    double gain = 1;        // the camera's levels over most others', by brightness alone
    double rms = 0;         // rms of the corrected camera's differences from others on held-out patches, levels
    bool is_stuck = false;  // the camera's exposure is not that of the others
  };
  std::vector<Camera> cameras;
  std::vector<Finding> findings;  // what a person must know, and what to do about it
};

// A quarter of the patches is held out of the fits by which terms are chosen: from brightness alone on, the term is
// added that brings cameras nearest to each other on these, as long as that is 3 % and 0.05 levels or more; the models
// are then fitted to all patches. Throws Error where there is nothing to compare.
ColourSolution solve_colours(const Rig& rig, const ColourSamples& samples, const ColourSolveOptions& options = {});

}  // namespace lf
