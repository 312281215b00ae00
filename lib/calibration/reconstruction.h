// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "calibration/solve.h"

namespace lf {

// A scene before anything is measured: lenses from the prior rig or as usual, with what is known of them. Throws Error
// where the prior rig lacks a camera of the tracks or has it in another size.
Reconstruction make_scene(const Tracks& tracks, const SolveOptions& options);

}  // namespace lf
