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

// Everything a node computes for a view, by one process for all cameras of the rig.
struct Production {
  Production(const Rig& rig, const Mesh& mesh, const View& view)
      : rig(rig), mesh(mesh), plan(rig, mesh, view), owners(plan, whole(view)) {}

  // The parts of all contributing cameras, in 8 bits.
  std::vector<Fragment> fragments(const std::vector<Image>& images) const;
  // The picture that they add up to.
  Image picture_of_parts(const std::vector<Image>& images) const;
  // The picture of one node of all cameras, of 16-bit sums.
  Image picture(const std::vector<Image>& images) const;

  // Without rounding to 8 bits.
  FloatStill sums(const std::vector<Image>& images) const;

  // The weights of all contributing cameras, each over the whole view (0 outside its rectangle).
  struct OwnWeights {
    CameraIndex camera;
    std::vector<float> weight;
  };
  std::vector<OwnWeights> own_weights() const;

  const Rig& rig;
  Mesh mesh;
  ViewPlan plan;
  OwnerMap owners;
};

std::vector<Image> i420_of(const std::vector<Image>& images);

// The folder of real data beside the repository, or "" where it is absent.
std::string data_folder(const std::string& name);
// The still of every camera.
std::vector<Image> load_images(const Rig& rig);

}  // namespace lf::test
