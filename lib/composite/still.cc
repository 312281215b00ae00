// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/still.h"

#include <numeric>
#include <string>

#include "base/error.h"
#include "render/contribution_map.h"
#include "render/render_job.h"
#include "render/sum_renderer.h"

namespace lf {

namespace {

// Too many cameras a pixel to round each of them to 8 bits.
void add_sum(const Rig& rig, const RenderJob& job, const CameraImages& images, Accumulator& sum, Still& still) {
  std::vector<Source> sources;
  for (const CameraIndex camera : job.cameras()) {
    const ImageView image = images(camera).view();
    sources.push_back({camera, &rig.cameras[camera], image});
    if (image.family != sources.front().image.family)
      throw Error("camera " + std::to_string(rig.cameras[camera].id) +
                  ": its image is not of the other images' pixel family");
  }
  if (sources.empty()) return;
  const PixelFamily family = sources.front().image.family;
  const SumRenderer renderer(job.plan(), job.runs(), sources, family);
  const Rect rect = renderer.rect();
  const size_t area = static_cast<size_t>(rect.width()) * rect.height();
  std::vector<int16_t> samples(3 * area);
  std::vector<uint16_t> lost(area);
  const bool any_lost =
      renderer.render_rows(rect.y0, rect.y1, packed_sums(family, rect, samples.data(), lost.data()));
  sum.reset(family, job.plan().view().width, job.plan().view().height);
  sum.add(packed_sums<const int16_t, const uint16_t>(family, rect, samples.data(), any_lost ? lost.data() : nullptr));
  still.fragments = 1;
  still.fragment_bytes = sizeof(int16_t) * packed_size(family, rect.width(), rect.height());
}

}  // namespace

Still render_still(const Rig& rig, const Mesh& mesh, const View& view, const FragmentRenderer& renderer,
                   const CameraImages& images, const Background& background) {
  std::vector<CameraIndex> all(rig.cameras.size());
  std::iota(all.begin(), all.end(), 0);
  const RenderJob job(rig, mesh, view, all);

  Still still;
  Accumulator sum;
  sum.reset(PixelFamily::kRgb, view.width, view.height);
  if (job.plan().blend()) add_sum(rig, job, images, sum, still);
  for (const CameraIndex camera : job.plan().blend() ? std::vector<CameraIndex>() : job.cameras()) {
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
