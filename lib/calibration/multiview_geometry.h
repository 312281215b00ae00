// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <vector>

#include "calibration/adjustment.h"
#include "geometry/pose.h"

namespace lf {

// Lists of observations: of each position, or of each camera, as indices.
std::vector<std::vector<uint32_t>> observations_of_positions(const Tracks& tracks);
std::vector<std::vector<uint32_t>> observations_of_cameras(const Tracks& tracks);

// A light of one place from the cameras that are used, mistaken ones among its `observations` (indices into the
// tracks', of one light). Nothing where no two of them agree to `threshold` pixels on a point in front of them.
struct Triangulated {
  Vec3 point;
  double agreement = 0;  // how many sights agree, softly
};
std::optional<Triangulated> triangulate(const std::vector<CameraState>& cameras, const Tracks& tracks,
                                        const std::vector<uint32_t>& observations, double threshold);

// Every target of the scene anew where that agrees with more sights than it does now. Targets of a bar become bars
// where both lights are found: of unit length, so the scene must be in that scale already.
void triangulate_targets(Reconstruction& scene, const Tracks& tracks, double threshold);

// Camera b as camera a sees it, from what both saw of the light: `a_from_b` with a distance of 1, which nothing tells.
struct RelativePose {
  size_t a = 0, b = 0;
  Pose a_from_b;
  double score = 0;  // sights that fit, for more where they cross at a wide angle
};

// The relative poses of those pairs of cameras that share most, so that each camera has several partners, by their
// essential matrices (the lenses are those in the scene). `threshold`: pixels.
std::vector<RelativePose> relative_poses(const Reconstruction& scene, const Tracks& tracks, double threshold);

struct RelativeRotation {
  size_t a = 0, b = 0;
  Quat a_from_b;
  double weight = 1;
};

// world_from_camera for each camera of the largest group that the pairs connect, so that they agree with most pairs
// (a spanning tree of the pairs that close most triangles, then reweighted least squares over the group of rotations:
// Chatterjee, Govindu 2013). The world is one camera's frame.
std::vector<std::optional<Quat>> average_rotations(size_t num_cameras, std::vector<RelativeRotation> pairs);

// The angle of a rotation, radians, 0 to pi.
double angle_of(const Quat& rotation);

}  // namespace lf
