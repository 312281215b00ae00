// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <vector>

#include "calibration/adjustment.h"
#include "geometry/pose.h"

namespace lf {

// Group the observations by position or by camera, as indices into the observations.
std::vector<std::vector<uint32_t>> observations_of_positions(const Tracks& tracks);
std::vector<std::vector<uint32_t>> observations_of_cameras(const Tracks& tracks);

// Triangulates a light from the used cameras; outliers do no harm. `observations` are indices of observations of one
// light. Returns nullopt if no two cameras agree within `threshold` pixels on a point in front of the cameras.
struct TriangulatedPoint {
  Vec3 point;
  double agreement = 0;  // number of inliers; doubtful ones count partly
};
std::optional<TriangulatedPoint> triangulate(const std::vector<CameraState>& cameras, const Tracks& tracks,
                                             const std::vector<uint32_t>& observations, double threshold);

// Triangulates each light again, and keeps the new position if it has more inliers. If both lights of a bar are found,
// the target becomes a bar of unit length, so the scene must already have this scale.
void triangulate_targets(Reconstruction& scene, const Tracks& tracks, double threshold);

// The pose of camera b relative to camera a, from common observations. Images do not determine the scale, so the
// cameras are 1 apart.
struct RelativePose {
  size_t a = 0, b = 0;
  Pose a_from_b;
  double score = 0;  // number of inliers, weighted by the angle between rays
};

// Returns relative poses from essential matrices, with the lenses of the scene. `threshold` is in pixels.
std::vector<RelativePose> relative_poses(const Reconstruction& scene, const Tracks& tracks, double threshold);

struct RelativeRotation {
  size_t a = 0, b = 0;
  Quat a_from_b;
  double weight = 1;
};

// Estimates the orientations of cameras from relative rotations. Returns world_from_camera for each camera of the
// largest connected group, in the frame of one of these cameras. Starts from a spanning tree of the pairs with most
// consistent triplets, then applies reweighted least squares on SO(3) (Chatterjee, Govindu 2013).
std::vector<std::optional<Quat>> average_rotations(size_t num_cameras, std::vector<RelativeRotation> pairs);

// Returns the rotation by |turn| radians about the axis `turn`.
Quat turned_by(const Vec3& turn);
// Returns the angle of a rotation in radians, 0 to pi.
double angle_of(const Quat& rotation);

}  // namespace lf
