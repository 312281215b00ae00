// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <vector>

#include "calibration/adjustment.h"
#include "geometry/pose.h"

namespace lf {

// Return the observations of each position, or of each camera, as indices.
std::vector<std::vector<uint32_t>> observations_of_positions(const Tracks& tracks);
std::vector<std::vector<uint32_t>> observations_of_cameras(const Tracks& tracks);

// Triangulates a light from used cameras, robust to outliers. `observations` are indices into the tracks' observations,
// all of one light. Returns nullopt if no two cameras agree within `threshold` pixels on a point in front of the
// cameras.
struct TriangulatedPoint {
  Vec3 point;
  double agreement = 0;  // soft inlier count
};
std::optional<TriangulatedPoint> triangulate(const std::vector<CameraState>& cameras, const Tracks& tracks,
                                             const std::vector<uint32_t>& observations, double threshold);

// Triangulates each target again, and keeps the new one if it has more inliers. If both lights of a bar are found, the
// target becomes a bar of unit length, so the scene must already have this scale.
void triangulate_targets(Reconstruction& scene, const Tracks& tracks, double threshold);

// Pose of camera b relative to camera a from common observations; the distance is 1, because scale is unknown.
struct RelativePose {
  size_t a = 0, b = 0;
  Pose a_from_b;
  double score = 0;  // inliers, weighted by the angle between rays
};

// Returns relative poses from essential matrices, with the lenses in the scene. Selects pairs with the largest overlap,
// so that each camera has several partners. `threshold`: pixels.
std::vector<RelativePose> relative_poses(const Reconstruction& scene, const Tracks& tracks, double threshold);

struct RelativeRotation {
  size_t a = 0, b = 0;
  Quat a_from_b;
  double weight = 1;
};

// Rotation averaging: returns world_from_camera for each camera of the largest connected group. It starts from a
// spanning tree of the pairs with most consistent triplets, then applies reweighted least squares on SO(3) (Chatterjee,
// Govindu 2013). The world is one camera's frame.
std::vector<std::optional<Quat>> average_rotations(size_t num_cameras, std::vector<RelativeRotation> pairs);

// Returns the angle of a rotation, radians, 0 to pi.
double angle_of(const Quat& rotation);

}  // namespace lf
