// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "reference/small_vec.h"
#include "rig/mesh.h"
#include "rig/rig.h"
#include "view/view.h"

namespace lf::reference {

// The weights of a view that is not blended by its mesh, as render/camera_weights.h states them, in 80-bit reals and
// rounded nowhere; shared with nothing.
class ReferenceBlending {
 public:
  // Nodes are `step` pixels apart. Everything must outlive this.
  ReferenceBlending(const Rig& rig, const Mesh& mesh, const View& view, int step);
  // Of every camera of the rig, in pixel (x, y), as if all lines of sight had a focus; they sum to 1.
  std::vector<Real> at(int x, int y) const;

 private:
  std::vector<Real> at_node(int x, int y) const;
  std::vector<Real> within_aperture(const V3& d) const;
  std::vector<Real> by_angle(const V3& d, const V3& in_focus) const;

  const Rig& rig_;
  const View& view_;
  const int step_, columns_;
  std::vector<CameraIndex> cameras_;
  std::vector<V3> centre_, forward_;  // of these; relative to the eye, axes of the world
  std::vector<std::vector<Real>> nodes_;
};

}  // namespace lf::reference
