// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/fragment_renderer.h"
#include "render/sum_renderer.h"
#include "render/sum_rounding.h"

namespace lf {
namespace {

class SimdRenderer : public FragmentRenderer {
 public:
  explicit SimdRenderer(Coordinates coordinates) : coordinates_(coordinates) {}

  std::optional<Fragment> render(const ViewPlan& plan, const OwnerMap& owners, CameraIndex camera,
                                 const Camera& rig_camera, const ImageView& image) const override {
    return render_fragment(plan, owners.runs(), {camera, &rig_camera, image}, coordinates_);
  }

 private:
  Coordinates coordinates_;
};

}  // namespace

std::optional<Fragment> render_fragment(const ViewPlan& plan, const OwnerRuns& runs, const Source& source,
                                        Coordinates coordinates) {
  const PixelFamily family = source.image.family;
  const SumRenderer renderer(plan, runs, {&source, 1}, family, coordinates);
  if (renderer.rect().empty()) return std::nullopt;
  Rect rect = CameraCorners(plan, source.camera).owned(runs, plan.camera_rect(source.camera));
  if (rect.empty()) return std::nullopt;
  const bool i420 = family == PixelFamily::kI420;
  if (i420) rect = chroma_aligned(rect, plan.view());

  thread_local std::vector<int16_t> sums;
  thread_local std::vector<uint16_t> lost;
  const size_t area = static_cast<size_t>(rect.width()) * rect.height();
  sums.resize(std::max(sums.size(), 3 * area));
  lost.resize(std::max(lost.size(), area));
  SumPlanes out{.family = family, .rect = rect, .lost = lost.data(), .lost_stride = rect.width()};
  for (int c = 0; c < 3; c++) {
    out.plane[c] = sums.data() + c * area;
    out.stride[c] = i420 && c > 0 ? chroma_size(rect.width()) : rect.width();
  }
  ConstSumPlanes sum{.family = family, .rect = rect};
  if (renderer.render_rows(rect.y0, rect.y1, out)) {
    sum.lost = out.lost;
    sum.lost_stride = out.lost_stride;
  }
  for (int c = 0; c < 3; c++) {
    sum.plane[c] = out.plane[c];
    sum.stride[c] = out.stride[c];
  }
  return rounded_fragment(source.camera, sum);
}

std::unique_ptr<FragmentRenderer> make_simd_renderer(Coordinates coordinates) {
  return std::make_unique<SimdRenderer>(coordinates);
}

}  // namespace lf
