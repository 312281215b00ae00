// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "rig/mesh.h"
#include "rig/rig.h"
#include "view/navigator.h"

namespace lf {

// How much of a view an array can fill: what keeps somebody who flies from ending in the dark. Immutable; thread-safe.
class VisibleShare {
 public:
  // Throws Error as build_mesh() does.
  explicit VisibleShare(const Rig& rig);

  // The share of the view's pixels, 0..1, that cameras can see, estimated on a coarse raster. Lines of sight are
  // followed to far away rather than to the focal plane, so that it does not depend on the focus. `aspect`: the view's
  // width over its height. Cost: that of a ViewPlan.
  double operator()(const Viewpoint& viewpoint, double aspect) const;

  // Where to begin: default_viewpoint(), but inside of the nearest triangle of cameras, of which three make each pixel,
  // rather than on an edge between two; and with the widest field of view, up to that of default_viewpoint(), that
  // leaves no pixel dark, at `focus_distance` (see there) and far away. Cost: that of a dozen ViewPlans.
  Viewpoint home(double aspect, double focus_distance = 0) const;

 private:
  bool sees_all(const Viewpoint& viewpoint, double aspect) const;

  Rig rig_;
  Mesh mesh_;
};

}  // namespace lf
