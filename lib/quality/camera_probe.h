// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "rig/mesh.h"
#include "view/view.h"
#include "view/view_request.h"

namespace lf {

// A view from where a camera stands, asked for twice: of the camera alone, and of the others without it. Both are view
// requests like any other: no camera gives more than its part in a small view.
struct CameraProbe {
  CameraIndex camera = 0;
  ViewRequest seen, predicted;  // view, out_of_service and probe are set
};

// At most this many columns: every so many pixels of the camera, each as it is, so that errors are those of its whole
// image, of fewer pixels.
inline constexpr int kProbeColumns = 80;

// `focused`: the view whose focal surface the others are focused on. `without` (ascending): cameras that predict nothing,
// beside the camera itself.
CameraProbe make_probe(const Rig& rig, CameraIndex camera, const View& focused, const CameraSet& without);

}  // namespace lf
