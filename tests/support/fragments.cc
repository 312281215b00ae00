// SPDX-License-Identifier: LGPL-2.1-or-later
#include "support/fragments.h"

#include "render/ownership.h"
#include "scene/scene.h"

namespace lf {

std::vector<Fragment> weighted_fragments(PixelFamily family, int side, int width, int height, int count) {
  const Rig rig = scene_rig(side, side);
  View view;
  view.width = width;
  view.height = height;
  // One metre behind the array, the array fills the view.
  const double extent = kScenePitch * (side - 1);
  view.lens = Lens(LensModel::kPinhole, {width / extent, height / extent, (width - 1) / 2., (height - 1) / 2.});
  view.pose.position = {0, 0, -1};
  view.focus.plane = plane_through({0, 0, kSceneMiddle}, {0, 0, 1});

  const int begin = std::max(0, (side * side - count) / 2);
  std::vector<CameraIndex> own;
  for (int i = begin; i < begin + count; i++) own.push_back(static_cast<CameraIndex>(i));
  const RenderJob job(rig, build_mesh(rig), view, own);
  std::vector<Fragment> fragments;
  for (const CameraIndex index : job.cameras()) {
    const Camera& camera = rig.cameras[index];
    Image image = render_scene({camera.width, camera.height, camera.lens, camera.pose}, 0, 1);
    if (family == PixelFamily::kI420) image = to_i420(image);
    auto fragment = test::camera_part(job.plan(), job.runs(), {index, &camera, image.view()});
    if (fragment) fragments.push_back(std::move(*fragment));
  }
  return fragments;
}

}  // namespace lf
