// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "calibration/adjustment.h"
#include "calibration/camera_clock.h"
#include "calibration/light_paths.h"

namespace lf {

// What one camera has at one instant by its clock: a light, or a reflection of one.
struct LightCandidate {
  uint32_t camera = 0, path = 0;  // `path`: number of a path of that camera
  PathPlace place;
  double brightness = 0;  // relative to what is usual in that camera
};
using LightCandidates = std::vector<LightCandidate>;
std::vector<LightCandidates> candidates_at(const std::vector<std::vector<LightPath>>& paths,
                                           const std::vector<double>& frame_times,
                                           const std::vector<CameraClock>& clocks, const std::vector<double>& instants);

// Tracks, with a position an instant, and for each of their observations what it was made of.
struct LightAssociation {
  Tracks tracks;
  std::vector<LightCandidate> made_of;
  std::vector<size_t> reflections;  // for each camera how many candidates are none of the lights
};

// Takes the brightest candidates for the lights, without geometry. The two of a bar are told apart by how the bar lies
// in the pictures of camera `reference` and of each other one, which are as linear in each other as the lights' motions
// are; only instants at which that camera sees both have positions with observations.
LightAssociation associate_by_brightness(const Tracks& cameras, const std::vector<LightCandidates>& candidates,
                                         size_t reference);

// Takes points for the lights on which the used cameras agree by their geometry, to `reach` pixels; two of them as far
// apart as a bar is long, where there is a bar (which is the unit of length then). Reflections in a flat window are
// such points, too: of two the brighter one is the light, and a path that is a reflection's more often than not is none
// all along.
LightAssociation associate_by_geometry(const Tracks& cameras, const std::vector<LightCandidates>& candidates,
                                       const std::vector<CameraState>& states, double reach);

}  // namespace lf
