// SPDX-License-Identifier: LGPL-2.1-or-later
#include <cmath>

#include "render/contribution.h"

namespace lf {
namespace {

using plain::Contribution;

uint8_t to_byte(float v) { return static_cast<uint8_t>(v + 0.5f); }
uint8_t to_signed_byte(float v) { return static_cast<uint8_t>(static_cast<int8_t>(std::lrintf(v))); }

class ScalarRenderer : public FragmentRenderer {
 public:
  explicit ScalarRenderer(Resampling resampling) : resampling_(resampling) {}

  std::optional<Fragment> render(const ViewPlan& plan, const OwnerMap& owners, CameraIndex camera,
                                 const Camera& rig_camera, const ImageView& image) const override {
    plain::check_image(rig_camera, image);
    Fragment fragment;
    fragment.camera = camera;
    fragment.family = image.family;
    if (plan.camera_rect(camera).empty()) return std::nullopt;
    const Contribution contribution(plan, owners, camera, rig_camera);
    fragment.rect = contribution.rect(camera);
    if (fragment.rect.empty()) return std::nullopt;
    if (image.family == PixelFamily::kI420) fragment.rect = chroma_aligned(fragment.rect, plan.view());
    const Rect& rect = fragment.rect;
    fragment.pixels.resize(packed_size(fragment.family, rect.width(), rect.height()));
    fragment.lost.resize(static_cast<size_t>(rect.width()) * rect.height());

    const bool any = image.family == PixelFamily::kI420 ? render_i420(contribution, image, fragment)
                                                        : render_rgb(contribution, image, fragment);
    if (!any) return std::nullopt;
    if (std::all_of(fragment.lost.begin(), fragment.lost.end(), [](uint8_t l) { return l == 0; }))
      fragment.lost.clear();
    return fragment;
  }

 private:
  bool render_rgb(const Contribution& contribution, const ImageView& image, Fragment& fragment) const {
    return contribution.for_each(fragment.rect, [&](int x, int y, float hat, bool valid, const Vec2& position) {
      const size_t i = plain::rect_offset(fragment.rect, x, y);
      if (!valid) {
        fragment.lost[i] = to_byte(255 * hat);
        return;
      }
      float rgb[3];
      plain::sample_rgb(image, position, resampling_, rgb);
      for (int c = 0; c < 3; c++) fragment.pixels[3 * i + c] = to_byte(hat * rgb[c]);
    });
  }

  bool render_i420(const Contribution& contribution, const ImageView& image, Fragment& fragment) const {
    const Rect& rect = fragment.rect;
    uint8_t* const y = fragment.pixels.data();
    uint8_t* const cb = y + static_cast<size_t>(rect.width()) * rect.height();
    uint8_t* const cr = cb + static_cast<size_t>(chroma_size(rect.width())) * chroma_size(rect.height());
    return plain::for_each_i420(
        contribution, image, resampling_, rect, [&](size_t i, float, float luma) { y[i] = to_byte(luma); },
        [&](size_t i, float weight) { fragment.lost[i] = to_byte(255 * weight); },
        [&](size_t i, float blue, float red) {
          cb[i] = to_signed_byte(blue);
          cr[i] = to_signed_byte(red);
        });
  }

  const Resampling resampling_;
};

}  // namespace

std::unique_ptr<FragmentRenderer> make_scalar_renderer(Resampling resampling) {
  return std::make_unique<ScalarRenderer>(resampling);
}

}  // namespace lf
