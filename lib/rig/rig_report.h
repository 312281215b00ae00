// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "rig/rig.h"

namespace lf {

// A summary of a rig for display. Lengths are in metres.
struct RigSummary {
  Vec3 extent{0, 0, 0};                   // size of the box around the cameras, along the world axes
  double baseline = 0;                    // distance between the two cameras that are farthest apart
  double mean_neighbour = 0;              // mean distance to the nearest other camera; 0 for one camera
  size_t triangles = 0, other_faces = 0;  // faces of the mesh: triangles, and other faces (strips and points)
  size_t images = 0, sources = 0;
  std::vector<std::string> lenses;  // one line per lens model, such as "RADIAL, f 386.7 px, 64 cameras of 320x240"
};
RigSummary summarize(const Rig& rig);

// Returns the arrangement of the cameras and mean_nearest_distance(), such as "grid of 4x8, 0.1 m between neighbouring
// cameras". The arrangement is a grid, a row if the mesh has no triangles, or irregular. Returns "" for a single
// camera.
std::string arrangement_text(const Rig& rig);

struct RigFinding {
  enum class Severity { kWarning, kError };
  Severity severity;
  std::string text;  // starts with the place, for example "cameras[3].image: ..."
};
// Returns lenses that cannot belong to their pictures, usually because of a wrong unit or resolution. Warnings are a
// focal length below a tenth of a side of the picture, a principal point outside the middle half of the picture, and a
// distortion that folds inside the picture. A lens that leaves less than a tenth of its picture is an error. Cameras
// with the same problem share a finding.
std::vector<RigFinding> check_lenses(const Rig& rig);

// Returns the problems of a rig that could be loaded, including problems of the lenses. All images are read. Errors are
// images that are missing, unreadable or of the wrong size, and missing source files. Warnings are cameras with the
// same file, a mesh without triangles, cameras without image and source, duplicate names, coincident cameras, very thin
// triangles, a mesh that most cameras look along, and a grid with cells that are not side by side.
std::vector<RigFinding> check_rig(const Rig& rig);

}  // namespace lf
