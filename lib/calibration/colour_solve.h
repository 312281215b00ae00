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

struct ColourFit {
  // One model per camera; cameras without samples have the default model.
  std::vector<ColourModel> models;
  // Logarithm of a camera's exposure relative to the mean. For example, 0.69 is twice the mean exposure.
  std::vector<double> log_exposure;
  std::vector<std::array<double, 15>> parameters;  // parameters of each camera, as a start for another fit
};

// Fits the parameters of all cameras and the colours of all patches in one least-squares problem. Residuals are the
// differences between samples and predicted levels in sigmas, under a Cauchy loss of 2. The patches of a chart have the
// same colours at all positions of the chart, except for one brightness and one linear gradient per position. This
// constrains vignetting.
//
// Colours are relative, so the mean camera is defined to be without faults, except for vignetting. Weak priors fix the
// remaining freedom. The resulting models are valid (model_error()); parameters are reduced if necessary.
//
// `apart` marks cameras that are left out of this mean (may be empty). `patches` marks the patches to use (empty: all).
// `start` is a fit with fewer terms, or null.
ColourFit fit_colours(const Rig& rig, const ColourSamples& samples, const ColourTerms& terms,
                      const std::vector<bool>& apart = {}, const std::vector<bool>& patches = {},
                      const ColourFit* start = nullptr);

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

// Returns the level that a camera's colour sample has after correction, including vignetting.
Vec3 corrected_level(const Camera& camera, const ColourModel& model, const ColourSample& sample);

struct ColourSolveOptions {
  std::function<void(const std::string& step)> progress;  // called before each step; may throw to cancel
};

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
// if fewer than two cameras can be compared.
ColourSolution solve_colours(const Rig& rig, const ColourSamples& samples, const ColourSolveOptions& options = {});

}  // namespace lf
