// SPDX-License-Identifier: LGPL-2.1-or-later
#include "reference/float_renderer.h"

#include "reference/contribution.h"
#include "render/sum_renderer.h"

namespace lf {
namespace {

using plain::Contribution;

bool render_rgb(const Contribution& contribution, const ImageView& image, FloatFragment& fragment) {
  return contribution.for_each(fragment.rect, [&](int x, int y, float own, bool valid, const Vec2& position) {
    const size_t i = plain::rect_offset(fragment.rect, x, y);
    if (!valid) {
      fragment.lost[i] = own;
      return;
    }
    fragment.valid[i] = own;
    float rgb[3];
    plain::sample_rgb(image, position, rgb);
    for (int c = 0; c < 3; c++) fragment.colour[3 * i + c] = own * rgb[c];
  });
}

bool render_i420(const Contribution& contribution, const ImageView& image, FloatFragment& fragment) {
  const Rect& rect = fragment.rect;
  float* const y = fragment.colour.data();
  float* const cb = y + static_cast<size_t>(rect.width()) * rect.height();
  float* const cr = cb + static_cast<size_t>(chroma_size(rect.width())) * chroma_size(rect.height());
  return plain::for_each_i420(
      contribution, image, rect,
      [&](size_t i, float weight, float luma) {
        fragment.valid[i] = weight;
        y[i] = luma;
      },
      [&](size_t i, float weight) { fragment.lost[i] = weight; },
      [&](size_t i, float blue, float red) {
        cb[i] = blue;
        cr[i] = red;
      });
}

}  // namespace

std::optional<FloatFragment> render_float(const ViewPlan& plan, const OwnerMap& owners, CameraIndex camera,
                                          const Camera& rig_camera, const ImageView& image) {
  check_image(rig_camera, image);
  if (plan.camera_rect(camera).empty()) return std::nullopt;
  const Contribution contribution(plan, owners, camera, rig_camera);
  FloatFragment fragment;
  fragment.family = image.family;
  fragment.rect = contribution.rect(camera);
  const Rect& rect = fragment.rect;
  if (rect.empty()) return std::nullopt;
  const bool i420 = image.family == PixelFamily::kI420;
  if (i420) fragment.rect = chroma_aligned(fragment.rect, plan.view());
  const size_t pixels = static_cast<size_t>(rect.width()) * rect.height();
  fragment.colour.resize(packed_size(image.family, rect.width(), rect.height()));
  fragment.valid.resize(pixels);
  fragment.lost.resize(pixels);
  if (!(i420 ? render_i420(contribution, image, fragment) : render_rgb(contribution, image, fragment)))
    return std::nullopt;
  return fragment;
}

}  // namespace lf
