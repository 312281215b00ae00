// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "geometry/focal_surface.h"
#include "geometry/lens.h"
#include "geometry/pose.h"

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

// One virtual camera: what to render.
struct View {
  int width = 0, height = 0;  // pixels, 1..kMaxImageSize
  Lens lens;
  Pose pose;  // world_from_view; position = the eye E
  FocalSurface focus;
  Blending blending;
  bool operator==(const View&) const = default;
};

// Throws Error ("width: ...", "orientation: ...", "focal_plane: ...", "focal_map: ...", "blending: ...") if a
// number is not finite, a size out of range, a quaternion or a plane normal not of unit length (kUnitTolerance).
void validate(const View& view);
// Throws Error ("NAME: ...") for pixels a side that no view has.
void validate_size(const char* name, int pixels);

// The view of an eye that stands `metres` to the right of the given view's (less than 0: to the left), as one of two
// eyes does: axes are parallel, the lens is the same, and the focal surface stays where it is in the world.
View seen_beside(const View& view, double metres);

// The plane facing the view at `distance` metres along its optical axis.
Plane focal_plane_at(const Pose& view_pose, double distance);

// The blending that a person chooses: by an aperture if there is one, else by angle if there is a number of cameras,
// else by the mesh.
Blending blending_of(double aperture, int nearest);

// Throws Error ("blending: ...") for an aperture that is not positive or a number out of range, and for either beside a
// kind that does not have it.
void validate(const Blending& blending);

}  // namespace lf
