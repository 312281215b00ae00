// SPDX-License-Identifier: LGPL-2.1-or-later
// When FocusControl doubts a surface through which the cameras agree: where they would through another depth, too.
#include <algorithm>

#include "focus/focus_control.h"
#include "focus/trial_levels.h"

namespace lf {

// Planes of searches and sweeps are where other depths are seen. The surface and the viewer's plane come first there.
void FocusControl::remember_planes(const ViewRequest& request, std::span<const Moments> moments) {
  constexpr size_t kPlane = 1, kFirst = 2;
  if (request.trials.size() < kSweep || request.trials[kPlane].kind != Trial::Kind::kFocused) return;
  std::vector<std::vector<uint8_t>> levels;
  for (const Trial& trial : request.trials) levels.push_back(trial_levels(request.view, trial));
  others_.add(request.view, levels, moments, {kPlane, kFirst});
}

// What the surface's squared deviation would be beside the plane's if it were wrong wherever another depth fits as
// well. While the eye is elsewhere that is what it was.
void FocusControl::doubt(const ViewRequest& request, const SurfaceChoice& choice, std::span<const Moments> moments,
                         size_t plane) {
  const bool is_sweep = request.trials.size() >= kSweep;
  Moments surface = moments[0];
  if (is_sweep)
    for (size_t i = 0; i < choice.chosen.size(); i++) {
      const Moments& chosen = moments[choice.chosen[i]];
      surface.weight[i] = chosen.weight[i];
      surface.luma[i] = chosen.luma[i];
      surface.square[i] = chosen.square[i];
    }
  const std::vector<uint8_t> levels = is_sweep ? choice.levels : trial_levels(request.view, request.trials[0]);
  const OtherDepths::Errors errors = others_.errors(request.view, levels, surface, moments[plane]);
  constexpr double kEnough = 0.25;  // of the nodes
  if (!(errors.known > kEnough) || !(errors.plane > 0) || !(errors.plane_disagrees > 0)) return;
  doubt_ = std::max(errors.surface / errors.plane - errors.surface_disagrees / errors.plane_disagrees, 0.);
}

}  // namespace lf
