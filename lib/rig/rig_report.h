// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "rig/rig.h"

namespace lf {

// Summary of a rig for display. Lengths in metres.
struct RigSummary {
  Vec3 extent{0, 0, 0};                   // size of the axis-aligned box around the cameras
  double baseline = 0;                    // distance between the two cameras that are farthest apart
  double mean_neighbour = 0;              // mean distance to the nearest other camera; 0: one camera
  size_t triangles = 0, other_faces = 0;  // faces of the mesh; other_faces: strips and points
  size_t images = 0, sources = 0;
  std::vector<std::string> lenses;  // "RADIAL, f 386.7 px, 64 cameras of 320x240": one line for each model
};
RigSummary summarize(const Rig& rig);

struct RigFinding {
  enum class Severity { kWarning, kError };
  Severity severity;
  std::string text;  // starts with the place: "cameras[3].image: ..."
};
// Returns the problems of a rig that loads. Reads every image. Errors: an image that is missing, unreadable or of the
// wrong size; a missing source file. Warnings: a mesh without triangles, cameras without image and source, duplicate
// names, coincident cameras, slivers in the mesh, a mesh that most cameras look along, a grid with cells that are not
// side by side.
std::vector<RigFinding> check_rig(const Rig& rig);

}  // namespace lf
