// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/still.h"

#include <numeric>
#include <optional>

#include "image/image_filters.h"
#include "render/camera_projection.h"
#include "render/contribution_map.h"
#include "render/ownership.h"
#include "render/sum_renderer.h"

namespace lf {

Still render_still(const Rig& rig, const Mesh& mesh, const View& view, const CameraImages& images,
                   Resampling resampling, const Background& background, gl::GlesRenderer* gpu,
                   const ArrayDepth* depths) {
  std::vector<CameraIndex> all(rig.cameras.size());
  std::iota(all.begin(), all.end(), 0);
  const RenderJob job(rig, mesh, view, all);

  Still still{.picture = {}, .coverage = {}, .cameras = job.cameras(), .drawing = {}};
  Accumulator sum;
  sum.reset(PixelFamily::kRgb, view.width, view.height);
  ByteBuffer sharp;
  std::vector<int16_t> samples;
  std::vector<uint16_t> lost;
  // Processes one camera at a time, so that a large array's images never share memory. The sum does not depend on the
  // grouping.
  const FocalMap* const map = view.focus.map.get();
  const bool is_measured = depths && map && map->measured;
  std::optional<DepthEdges> edges;
  if (is_measured && map->step == FocalMap::kMinStep) edges = depths->edges(view);
  for (const CameraIndex camera : job.cameras()) {
    const Camera& rig_camera = rig.cameras[camera];
    Source source{camera, &rig_camera, images(camera).view()};
    if (camera == job.cameras().front()) sum.reset(source.image.family, view.width, view.height);
    if (resampling == Resampling::kSharpened && shows_detail(view, rig_camera))
      source.image = sharpen(source.image, needed_pixels(job.plan(), camera, rig_camera), sharp);
    std::optional<VisibilityMask> visibility;
    if (is_measured)
      visibility = depths->visibility(job.plan().view(), camera,
                                      sum_tiles(job.plan(), job.runs(), {&camera, 1}, PixelFamily::kRgb, 0),
                                      edges ? &*edges : nullptr);
    source.visibility = visibility ? &*visibility : nullptr;
    source.edges = edges ? &*edges : nullptr;
    const SumRenderer renderer(job.plan(), job.runs(), {&source, 1}, sum.family(), Coordinates::kGrid, gpu);
    still.drawing = renderer.drawing();
    const Rect rect = renderer.rect();
    const size_t area = static_cast<size_t>(rect.width()) * rect.height();
    samples.resize(3 * area);
    lost.resize(area);
    const bool any_missing =
        renderer.render_rows(rect.y0, rect.y1, packed_sums(sum.family(), rect, samples.data(), lost.data()));
    sum.add(packed_sums<const int16_t, const uint16_t>(sum.family(), rect, samples.data(),
                                                       any_missing ? lost.data() : nullptr));
  }
  const FaceIdMap owners(job.plan(), {0, 0, view.width, view.height});
  sum.set_uncovered(owners);
  // A mask reduces the weight of a camera, but not the coverage.
  still.coverage = depths ? view_coverage(rig, job.plan(), owners) : sum.coverage();
  still.picture = sum.resolve(background);
  return still;
}

}  // namespace lf
