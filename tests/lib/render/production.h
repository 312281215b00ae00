// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "image/image.h"
#include "reference/float_renderer.h"
#include "render/ownership.h"
#include "render/sum_planes.h"
#include "render/view_plan.h"
#include "rig/mesh.h"
#include "rig/rig.h"

namespace lf::test {

Rect whole(const View& view);

// Everything that a node with all cameras of the rig computes for a view.
struct Production {
  Production(const Rig& rig, const Mesh& mesh, const View& view)
      : rig(rig), mesh(mesh), plan(rig, mesh, view), owners(plan, whole(view)) {}

  std::vector<Fragment> fragments(const std::vector<Image>& images) const;
  Image picture_of_parts(const std::vector<Image>& images) const;
  // Returns the picture of one node with all cameras, from 16-bit sums.
  Image picture(const std::vector<Image>& images) const;

  FloatStill sums(const std::vector<Image>& images) const;

  // The weights of all contributing cameras over the whole view (0 outside their rectangles).
  struct OwnWeights {
    CameraIndex camera;
    std::vector<float> weight;
  };
  std::vector<OwnWeights> own_weights() const;

  const Rig& rig;
  Mesh mesh;
  ViewPlan plan;
  FaceIdMap owners;
};

std::vector<Image> i420_of(const std::vector<Image>& images);

// Returns the folder of real data beside the repository, or "" if absent.
std::string data_folder(const std::string& name);
std::vector<Image> load_images(const Rig& rig);

}  // namespace lf::test
