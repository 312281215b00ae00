// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "geometry/focal_surface.h"
#include "geometry/lens.h"
#include "geometry/pose.h"
#include "view/blending.h"

namespace lf {

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

// The same view from an eye `metres` to the right of it (less than 0: to the left), as one of two eyes has it: axes and
// lens are parallel, and the focal surface stays where it is in the world.
View seen_beside(const View& view, double metres);

// The plane facing the view at `distance` metres along its optical axis.
Plane focal_plane_at(const Pose& view_pose, double distance);

}  // namespace lf
