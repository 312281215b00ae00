// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "reference/generators.h"

// The hard cases of numerical stability: one list for the tests that hold the bounds and for `bench-render numerics`,
// which prints what is left of them.
namespace lf::reference {

struct HardCase {
  const char* name;
  std::function<std::pair<Rig, View>(Random&)> make;  // for the n-th of `trials`: from a Random of seed n
  int trials = 8;
  double least_owned = 0.2;  // fraction of pixels that some face owns: the case is about something
};
std::vector<HardCase> hard_cases();
// The same seen by cameras and a view of `times` as many rows and columns, where fast renderers leave the borders of
// their blocks behind; two trials.
inline constexpr int kEnlarged = 3;
HardCase enlarged(const HardCase& hard, int times);

// What most of them are made of: a view of 48x36 pixels; 4x4 cameras, 0.5 m apart, all corners at quarters of a metre.
View view_at(const Vec3& eye, const Quat& orientation = {1, 0, 0, 0}, double fov_y = 60, double focus = 2);
Rig array();
// The same with a pose in the world that is not made of round numbers.
std::pair<Rig, View> moved(Rig rig, View view, const Vec3& by, const Quat& turn);

}  // namespace lf::reference
