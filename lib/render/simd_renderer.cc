// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/fragment_set.h"
#include "render/sum_renderer.h"

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

void append_rows(std::vector<uint8_t>& out, const uint8_t* rows, ptrdiff_t stride, int width, int height) {
  for (int y = 0; y < height; y++) out.insert(out.end(), rows + y * stride, rows + y * stride + width);
}

}  // namespace

std::optional<Fragment> render_fragment(const ViewPlan& plan, const OwnerRuns& runs, const Source& source,
                                        Coordinates coordinates) {
  thread_local FragmentSet set;
  set.begin(plan, runs, {&source, 1}, source.image.family, coordinates);
  if (set.rect().empty()) return std::nullopt;
  set.render_rows(set.rect().y0, set.rect().y1);
  if (set.fragments().empty()) return std::nullopt;
  const FragmentPlanes& planes = set.fragments()[0].planes;
  const int w = planes.rect.width(), h = planes.rect.height();
  Fragment fragment{.camera = source.camera, .family = planes.family, .rect = planes.rect};
  fragment.pixels.reserve(packed_size(planes.family, w, h));
  if (planes.family == PixelFamily::kRgb) {
    append_rows(fragment.pixels, planes.plane[0], planes.stride[0], 3 * w, h);
  } else {
    append_rows(fragment.pixels, planes.plane[0], planes.stride[0], w, h);
    for (int c = 1; c < 3; c++)
      append_rows(fragment.pixels, planes.plane[c], planes.stride[c], chroma_size(w), chroma_size(h));
  }
  if (planes.lost) append_rows(fragment.lost, planes.lost, planes.lost_stride, w, h);
  return fragment;
}

std::unique_ptr<FragmentRenderer> make_simd_renderer(Coordinates coordinates) {
  return std::make_unique<SimdRenderer>(coordinates);
}

}  // namespace lf
