// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>
#include <vector>

#include "rig/triangle.h"

namespace lf {

// A part of the link of a camera (the edges opposite it in the triangles around it): cameras in walking order.
struct LinkPart {
  std::vector<CameraIndex> camera;
  bool closed = false;  // a ring around an inner camera; else a chain, as at the border of the mesh
};

// The link of `camera`; `star`: the triangles that have it as a corner. Each part is walked the way its first
// triangle in `star` turns, and has at least three cameras. Usually one part; several where parts of the mesh meet in
// the camera alone. Triangles with repeated corners are ignored. Empty where three edges of the link meet in a camera
// (not a surface).
std::vector<LinkPart> camera_link(std::span<const Triangle> star, CameraIndex camera);

}  // namespace lf
