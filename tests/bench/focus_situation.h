// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "focus/focus_control.h"
#include "image/image.h"
#include "rig/rig.h"
#include "view/view.h"

namespace lf::focus {

// Somebody looks at a still scene through some array: all that may go wrong with a focal surface, drawn at random.
struct Situation {
  std::string text;  // one line for people
  Rig rig;
  std::vector<Image> images;              // of each camera
  std::function<View(int picture)> view;  // on the viewer's plane
  std::function<Image(const View&)> truth;
  FocusMode mode = FocusMode::kAuto;
  bool moves = false;  // the eye
};
Situation random_situation(uint64_t seed);

// What a viewer sees, picture after picture, of the surface and of the plane that the view asks for.
struct Seen {
  int picture = 0;
  double plane_db = 0, surface_db = 0;  // over the pixels that both cover
  double near = 0, far = 0;             // metres
};
struct Watched {
  std::vector<Seen> seen;
  Image truth, plane, surface;  // where the surface is worst beside the plane
  int worst = -1;               // of `seen`; -1: nothing is covered
  double lead() const { return worst < 0 ? 0 : seen[worst].surface_db - seen[worst].plane_db; }
};
Watched watch(const Situation& situation, const std::vector<int>& pictures);

}  // namespace lf::focus
