// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "rig/rig.h"

namespace lf {

// What a person wants to know about a rig. Lengths in metres.
struct RigSummary {
  Vec3 extent{0, 0, 0};                   // size of the box around the cameras, along the axes of the world
  double baseline = 0;                    // distance of the two cameras farthest apart
  double mean_neighbour = 0;              // mean over cameras of the distance to the nearest other one; 0: one camera
  size_t triangles = 0, other_faces = 0;  // faces of the mesh; others: strips and points
  size_t images = 0, sources = 0;         // cameras that have one
  std::vector<std::string> lenses;        // "RADIAL, f 386.7 px, 64 cameras of 320x240": a line for each model
};
RigSummary summarize(const Rig& rig);

struct RigFinding {
  enum class Severity { kWarning, kError };
  Severity severity;
  std::string text;  // names the place: "cameras[3].image: ..."
};
// What is wrong with a rig that could be loaded. Errors: an image that is missing, can't be read or has another size
// than its camera; a source that is a file and is missing. Warnings: a mesh without a triangle, cameras without a
// picture, equal names, several cameras at one place, slivers in the mesh, a mesh that most cameras look along, a grid
// whose cells do not lie side by side. Reads every image.
std::vector<RigFinding> check_rig(const Rig& rig);

}  // namespace lf
