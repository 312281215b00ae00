// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "render/view_plan.h"

namespace lf {

// What cameras have to be told of a view to render their parts of it without knowing where they or any others stand:
// the plan of the view with the projections into the cameras. All is relative to the view's eye.
struct ViewWarp {
  int width = 0, height = 0;    // pixels of the view
  Lens lens;                    // the view's lens
  Vec3 in_front{0};             // lines of sight d with in_front . d > 0 meet the focal plane
  std::vector<FacePlan> faces;  // as in ViewPlan, numbered in their order

  struct Projection {
    CameraIndex camera = 0;
    Mat3 camera_from_ray{1};  // see CameraProjection
    bool operator==(const Projection&) const = default;
  };
  std::vector<Projection> cameras;  // ascending: the faces' corners, each once

  bool operator==(const ViewWarp&) const = default;
};

// What cameras are to be told of the plan. `rig`: that of the plan.
ViewWarp view_warp(const Rig& rig, const ViewPlan& plan);

// Throws Error naming the field where a ViewPlan can't be made of it: sizes, numbers that are not finite, rectangles
// that are empty or not inside the view, cameras that are not just the faces' corners.
void validate(const ViewWarp& warp);

}  // namespace lf
