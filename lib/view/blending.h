// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

namespace lf {

// How many cameras make a pixel, and with which weights; see render/camera_weights.h.
struct Blending {
  enum class Kind {
    kMesh = 0,      // the corners of the triangle of cameras that the line of sight passes, as in the paper
    kAperture = 1,  // all cameras within a synthetic aperture around the line of sight
    kAngle = 2,     // the cameras that see what is in focus most nearly as the view does, as sharply, and at all
  };
  static constexpr double kMaxAperture = 1e6;  // metres
  static constexpr int kMaxNearest = 32;

  Kind kind = Kind::kMesh;
  double aperture = 0;  // kAperture: diameter, metres
  int nearest = 0;      // kAngle: how many cameras, 1..kMaxNearest

  bool is_mesh() const { return kind == Kind::kMesh; }
  bool operator==(const Blending&) const = default;
};

// As people choose it: by an aperture if there is one, else by angle if there is a number of cameras, else by the mesh.
Blending blending_of(double aperture, int nearest);

// Throws Error ("blending: ...") for an aperture that is not positive or a number out of range, and for either beside a
// kind that does not have it.
void validate(const Blending& blending);

}  // namespace lf
