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

// Colour parameters that may differ between cameras, in addition to brightness.
struct ColourTerms {
  bool balance = false;  // gains of red and blue, relative to green
  bool black = false;    // black level per channel
  bool gamma = false;
  bool crosstalk = false;   // matrix between channels that preserves greys
  bool vignetting = false;  // k1 and k2
  bool operator==(const ColourTerms&) const = default;

  // Returns for example "brightness, white balance and vignetting".
  std::string name() const;
};

struct ColourFit {
  // One model per camera; the default model for cameras without samples.
  std::vector<ColourModel> models;
  // Logarithm of a camera's exposure relative to the mean: 0.69 is twice the exposure.
  std::vector<double> log_exposure;
  std::vector<std::array<double, 15>> parameters;  // parameters per camera, the start of another fit
};

// Fits the parameters of all cameras and the colours of all patches in one least-squares problem. Residuals are the
// differences between samples and predicted levels, over sigma, under a Cauchy loss of 2. Patches of a chart have the
// same colours at all chart positions, up to a brightness and a linear gradient per position; this constrains
// vignetting. Gauge: the mean of the cameras' parameters, except vignetting, is a camera without faults. Weak priors
// fix the remaining freedom.
//
// `apart`: cameras that are excluded from that mean, one value per camera; may be empty. `patches`: patches that take
// part; empty: all. `start`: a fit with fewer terms; may be null. Models are valid (model_error()), if necessary after
// shrinking the parameters.
ColourFit fit_colours(const Rig& rig, const ColourSamples& samples, const ColourTerms& terms,
                      const std::vector<bool>& apart = {}, const std::vector<bool>& patches = {},
                      const ColourFit* start = nullptr);

// Colour differences of corrected cameras at common patches, per channel and pair of cameras, in levels.
struct ColourDifferences {
  double median = 0, p95 = 0, rms = 0;
  size_t pairs = 0;
};
// Compares the patches and cameras that are true in the lists (empty: all). The RMS limits differences to 12 levels,
// because larger differences have other causes.
ColourDifferences colour_differences(const Rig& rig, const ColourSamples& samples,
                                     const std::vector<ColourModel>& models, const std::vector<bool>& patches = {},
                                     const std::vector<bool>& cameras = {});

// Returns the sample's level after correction, including vignetting.
Vec3 corrected_level(const Camera& camera, const ColourModel& model, const ColourSample& sample);

struct ColourSolveOptions {
  std::function<void(const std::string& step)> progress;  // called before each step; may throw to cancel
};

// Colour models of an array, with as few parameters as the samples require.
struct ColourSolution {
  // One model per camera; nullopt for cameras with too few samples.
  std::vector<std::optional<ColourModel>> models;
  ColourTerms terms;
  // A tested set of terms, and the remaining differences on held-out patches.
  struct Trial {
    ColourTerms terms;
    ColourDifferences held_out;
  };
  std::vector<Trial> trials;
  // Differences on the held-out patches without correction, and after the fit to the other patches. Cameras with a
  // wrong exposure are left out.
  ColourDifferences before, after;
  struct Camera {
    size_t samples = 0;     // samples with a usable channel
    double clipped = 0;     // share of the camera's samples with a clipped channel
    double gain = 1;        // levels relative to the median camera, from brightness alone
    double rms = 0;         // RMS difference of the corrected camera from others on held-out patches, levels
    bool is_stuck = false;  // true if the exposure is far from the median
  };
  std::vector<Camera> cameras;
  std::vector<Finding> findings;
};

// Selects the terms by fits without a quarter of the patches. Starting from brightness alone, each round adds the term
// that reduces the differences on these held-out patches most, as long as it gains at least 3 % and 0.05 levels. The
// final models are fitted to all patches. Throws Error if fewer than two cameras can be compared.
ColourSolution solve_colours(const Rig& rig, const ColourSamples& samples, const ColourSolveOptions& options = {});

}  // namespace lf
