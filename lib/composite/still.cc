// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/still.h"

#include <numeric>
#include <string>

#include "base/error.h"
#include "render/contribution_map.h"
#include "render/render_job.h"

namespace lf {

Still render_still(const Rig& rig, const Mesh& mesh, const View& view, const FragmentRenderer& renderer,
                   const CameraImages& images, const Background& background) {
  std::vector<CameraIndex> all(rig.cameras.size());
  std::iota(all.begin(), all.end(), 0);
  const RenderJob job(rig, mesh, view, all);

  Still still;
  Accumulator sum;
  sum.reset(PixelFamily::kRgb, view.width, view.height);
  for (const CameraIndex camera : job.cameras()) {
    const Camera& rig_camera = rig.cameras[camera];
    const Image& image = images(camera);
    const std::optional<Fragment> fragment =
        renderer.render(job.plan(), job.owners(), camera, rig_camera, image.view());
    if (!fragment) continue;
    if (still.fragments == 0) sum.reset(fragment->family, view.width, view.height);
    if (!sum.add(*fragment))
      throw Error("camera " + std::to_string(rig_camera.id) + ": its image is not of the other images' pixel family");
    still.fragments++;
    still.fragment_bytes += fragment->bytes();
  }
  still.coverage = view_coverage(rig, job.plan(), job.owners());
  if (background != Background{}) sum.set_uncovered(OwnerMap(job.plan(), {0, 0, view.width, view.height}));
  still.picture = sum.resolve(background);
  return still;
}

}  // namespace lf
