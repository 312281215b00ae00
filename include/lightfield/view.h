// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>

#include <lightfield/rig.h>

namespace lightfield {

// A virtual camera: what is to be seen.
struct View {
  int width = 640, height = 480;  // pixels, 1 to 16384
  Pose world_from_view = {};
  double fov_y = 45;              // degrees from the top to the bottom, above 0 and below 180
  std::optional<Lens> lens = {};  // any lens, distorted or off centre, in place of fov_y
  double focus_distance = 2;      // metres along the optical axis to the plane that is sharp: it faces the view
  double aperture = 0;            // metres: a lens so wide, which blurs what is off that plane; 0: as sharp as can be
};

// A view to begin with: it stands amid the cameras, looking where they look, with the vertical field of view of the
// middle one, focused at four times the diameter of the array (at 1 m where it has none). Throws Error for sizes that
// no view has.
View home_view(const Rig& rig, int width, int height);

// How a view is focused.
enum class Focus : uint8_t {
  kPlane,  // on the plane at focus_distance
  kAuto,  // every pixel on its own, on a surface that is found from where the cameras agree, better with every picture;
          // on the plane until that is clearly better. See docs/focus.md
};

// A colour, full range.
struct Colour {
  uint8_t r = 0, g = 0, b = 0;
};

}  // namespace lightfield
