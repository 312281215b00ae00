// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "calibration/colour_fit.h"
#include "calibration/report.h"

namespace lf {

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
