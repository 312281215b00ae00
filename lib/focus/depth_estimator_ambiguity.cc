// SPDX-License-Identifier: LGPL-2.1-or-later
// Ambiguity test of DepthEstimator: doubts a surface if the cameras also agree through another depth.
#include <algorithm>

#include "focus/depth_estimator.h"
#include "focus/hypothesis_levels.h"

namespace lf {

// Stores the results of a search or a sweep in others_. Their first two hypotheses are the surface and the viewer's
// plane, and all others are planes.
void DepthEstimator::remember_planes(const ViewRequest& request, std::span<const PhotoConsistency> moments) {
  constexpr size_t kPlane = 1, kFirst = 2;
  if (request.hypotheses.size() < kSweep || request.hypotheses[kPlane].kind != DepthHypothesis::Kind::kFocused) return;
  const std::vector<std::vector<uint8_t>> levels = hypothesis_levels(request.view, request.hypotheses);
  others_.add(request.view, levels, moments, {kPlane, kFirst});
}

// Updates doubt_, the squared error of the surface that its deviation does not show, relative to the plane's squared
// error. The estimate assumes that the surface is wrong wherever another depth fits as well. It stays unchanged while
// the viewpoint is elsewhere than in the search or sweep.
void DepthEstimator::doubt(const ViewRequest& request, const DepthSelection& choice,
                           std::span<const PhotoConsistency> moments, size_t plane) {
  const bool is_sweep = request.hypotheses.size() >= kSweep;
  PhotoConsistency surface = moments[0];
  if (is_sweep)
    for (size_t i = 0; i < choice.chosen.size(); i++) {
      const PhotoConsistency& chosen = moments[choice.chosen[i]];
      surface.weight[i] = chosen.weight[i];
      surface.luma[i] = chosen.luma[i];
      surface.square[i] = chosen.square[i];
    }
  const std::vector<uint8_t> levels = is_sweep ? choice.levels : hypothesis_levels(request.view, request.hypotheses[0]);
  const DepthAmbiguity::Errors errors = others_.errors(request.view, levels, surface, moments[plane]);
  constexpr double kEnough = 0.25;  // least fraction of the nodes for an estimate
  if (!(errors.known > kEnough) || !(errors.plane > 0) || !(errors.plane_disagrees > 0)) return;
  doubt_ = std::max(errors.surface / errors.plane - errors.surface_disagrees / errors.plane_disagrees, 0.);
}

}  // namespace lf
