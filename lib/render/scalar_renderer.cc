// SPDX-License-Identifier: LGPL-2.1-or-later
#include <cmath>
#include <string>

#include "base/error.h"
#include "render/camera_projection.h"
#include "render/fragment_renderer.h"

namespace lf {
namespace {

void check_image(const Camera& camera, const ImageView& image) {
  if (image.width != camera.width || image.height != camera.height)
    throw Error("camera " + std::to_string(camera.id) + ": its image has " + std::to_string(image.width) + "x" +
                std::to_string(image.height) + " pixels, the rig says " + std::to_string(camera.width) + "x" +
                std::to_string(camera.height));
}

uint8_t to_byte(float v) { return static_cast<uint8_t>(v + 0.5f); }
int8_t to_signed_byte(float v) { return static_cast<int8_t>(std::lrintf(v)); }

// Bilinear sampling of one 8-bit channel; coordinates are clamped to the outer pixel centres.
struct Bilinear {
  Bilinear(const Vec2& position, int width, int height) {
    const double x = std::clamp(position.x, 0.0, width - 1.0), y = std::clamp(position.y, 0.0, height - 1.0);
    x0 = static_cast<int>(x);
    y0 = static_cast<int>(y);
    x1 = std::min(x0 + 1, width - 1);
    y1 = std::min(y0 + 1, height - 1);
    ax = static_cast<float>(x - x0);
    ay = static_cast<float>(y - y0);
  }
  float sample(const uint8_t* plane, ptrdiff_t stride, int pixel_stride) const {
    const uint8_t *top = plane + y0 * stride, *bottom = plane + y1 * stride;
    const float a = top[x0 * pixel_stride], b = top[x1 * pixel_stride];
    const float c = bottom[x0 * pixel_stride], d = bottom[x1 * pixel_stride];
    const float upper = a + (b - a) * ax, lower = c + (d - c) * ax;
    return upper + (lower - upper) * ay;
  }
  int x0, y0, x1, y1;
  float ax, ay;
};

void sample_rgb(const ImageView& image, const Vec2& position, float rgb[3]) {
  const Bilinear at(position, image.width, image.height);
  const RgbLayout& layout = image.layout;
  rgb[0] = at.sample(image.plane[0] + layout.r, image.stride[0], layout.pixel_stride);
  rgb[1] = at.sample(image.plane[0] + layout.g, image.stride[0], layout.pixel_stride);
  rgb[2] = at.sample(image.plane[0] + layout.b, image.stride[0], layout.pixel_stride);
}

// One camera's part in one view, pixel by pixel.
class Contribution {
 public:
  Contribution(const ViewPlan& plan, const OwnerMap& owners, CameraIndex camera, const Camera& rig_camera)
      : plan_(plan), owners_(owners), corners_(plan, camera), projection_(plan, rig_camera) {}

  float hat(int x, int y) const { return corners_.weight(plan_, owners_.at(x, y), plan_.rays().at(x, y)); }
  bool project(const Vec2& ray, Vec2& pixel) const { return projection_.project(ray, pixel); }
  const Rays& rays() const { return plan_.rays(); }
  Rect rect(CameraIndex camera) const { return corners_.owned(owners_, plan_.camera_rect(camera)); }

  // Calls fn(x, y, hat, valid, position in the camera's image) for the pixels of `rect` with a weight. False if none
  // has.
  template <class Fn>
  bool for_each(const Rect& rect, const Fn& fn) const {
    bool any = false;
    for (int y = rect.y0; y < rect.y1; y++)
      for (int x = rect.x0; x < rect.x1; x++) {
        const float w = hat(x, y);
        if (w == 0) continue;
        any = true;
        Vec2 position;
        const bool valid = project(rays().at(x, y), position);
        fn(x, y, w, valid, position);
      }
    return any;
  }

 private:
  const ViewPlan& plan_;
  const OwnerMap& owners_;
  CameraCorners corners_;
  CameraProjection projection_;
};

class ScalarRenderer : public FragmentRenderer {
 public:
  std::optional<Fragment> render(const ViewPlan& plan, const OwnerMap& owners, CameraIndex camera,
                                 const Camera& rig_camera, const ImageView& image) const override {
    check_image(rig_camera, image);
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
  static size_t offset(const Rect& rect, int x, int y) {
    return static_cast<size_t>(y - rect.y0) * rect.width() + (x - rect.x0);
  }

  static bool render_rgb(const Contribution& contribution, const ImageView& image, Fragment& fragment) {
    return contribution.for_each(fragment.rect, [&](int x, int y, float hat, bool valid, const Vec2& position) {
      const size_t i = offset(fragment.rect, x, y);
      if (!valid) {
        fragment.lost[i] = to_byte(255 * hat);
        return;
      }
      float rgb[3];
      sample_rgb(image, position, rgb);
      for (int c = 0; c < 3; c++) fragment.pixels[3 * i + c] = to_byte(hat * rgb[c]);
    });
  }

  // Chroma has the mean valid weight of its (up to four) luma pixels, so that luma and chroma of all cameras together
  // are covered alike.
  static bool render_i420(const Contribution& contribution, const ImageView& image, Fragment& fragment) {
    const Rect& rect = fragment.rect;
    const int chroma_width = chroma_size(rect.width()), chroma_height = chroma_size(rect.height());
    struct Block {
      float weight = 0;
      Vec2 position;  // of one valid luma sample
    };
    std::vector<Block> blocks(static_cast<size_t>(chroma_width) * chroma_height);
    const bool any = contribution.for_each(rect, [&](int x, int y, float hat, bool valid, const Vec2& position) {
      const size_t i = offset(rect, x, y);
      if (!valid) {
        fragment.lost[i] = to_byte(255 * hat);
        return;
      }
      const Bilinear at(position, image.width, image.height);
      fragment.pixels[i] = to_byte(hat * at.sample(image.plane[0], image.stride[0], 1));
      Block& block = blocks[static_cast<size_t>((y - rect.y0) / 2) * chroma_width + (x - rect.x0) / 2];
      block.weight += hat;
      block.position = position;
    });
    uint8_t* const cb = fragment.pixels.data() + static_cast<size_t>(rect.width()) * rect.height();
    uint8_t* const cr = cb + blocks.size();
    for (int cy = 0; cy < chroma_height; cy++)
      for (int cx = 0; cx < chroma_width; cx++) {
        const size_t i = static_cast<size_t>(cy) * chroma_width + cx;
        if (blocks[i].weight == 0) continue;
        const int x = rect.x0 + 2 * cx, y = rect.y0 + 2 * cy;
        const int pixels = (x + 1 < rect.x1 ? 2 : 1) * (y + 1 < rect.y1 ? 2 : 1);
        const float weight = blocks[i].weight / static_cast<float>(pixels);
        Vec2 position;
        if (!contribution.project(contribution.rays().at_centre_of_four(x, y), position)) position = blocks[i].position;
        const Vec2 chroma_position = (position - 0.5) / 2.0;
        const Bilinear at(chroma_position, chroma_size(image.width), chroma_size(image.height));
        cb[i] = static_cast<uint8_t>(to_signed_byte(weight * (at.sample(image.plane[1], image.stride[1], 1) - 128)));
        cr[i] = static_cast<uint8_t>(to_signed_byte(weight * (at.sample(image.plane[2], image.stride[2], 1) - 128)));
      }
    return any;
  }
};

}  // namespace

Rect chroma_aligned(const Rect& rect, const View& view) {
  return {rect.x0 & ~1, rect.y0 & ~1, std::min((rect.x1 + 1) & ~1, view.width),
          std::min((rect.y1 + 1) & ~1, view.height)};
}

std::unique_ptr<FragmentRenderer> make_scalar_renderer() { return std::make_unique<ScalarRenderer>(); }

std::optional<FloatFragment> render_float(const ViewPlan& plan, const OwnerMap& owners, CameraIndex camera,
                                          const Camera& rig_camera, const ImageView& image) {
  check_image(rig_camera, image);
  if (plan.camera_rect(camera).empty()) return std::nullopt;
  const Contribution contribution(plan, owners, camera, rig_camera);
  FloatFragment fragment;
  fragment.rect = contribution.rect(camera);
  const Rect& rect = fragment.rect;
  if (rect.empty()) return std::nullopt;
  const size_t pixels = static_cast<size_t>(rect.width()) * rect.height();
  fragment.colour.resize(3 * pixels);
  fragment.valid.resize(pixels);
  fragment.lost.resize(pixels);
  const bool any = contribution.for_each(rect, [&](int x, int y, float hat, bool valid, const Vec2& position) {
    const size_t i = static_cast<size_t>(y - rect.y0) * rect.width() + (x - rect.x0);
    if (!valid) {
      fragment.lost[i] = hat;
      return;
    }
    fragment.valid[i] = hat;
    float rgb[3];
    sample_rgb(image, position, rgb);
    for (int c = 0; c < 3; c++) fragment.colour[3 * i + c] = hat * rgb[c];
  });
  if (!any) return std::nullopt;
  return fragment;
}

}  // namespace lf
