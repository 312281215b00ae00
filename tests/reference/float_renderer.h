// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <optional>
#include <vector>

#include "image/image.h"
#include "render/camera_projection.h"
#include "render/ownership.h"
#include "rig/rig.h"
#include "rig/still_image_cache.h"

// The contribution of one camera to a view, pixel by pixel; shared by the plain renderers.
namespace lf::plain {

inline void sample_rgb(const ImageView& image, const Vec2& position, float rgb[3]) {
  const Sampler at(position, image.width, image.height);
  const RgbLayout& layout = image.layout;
  rgb[0] = at.sample(image.plane[0] + layout.r, image.stride[0], layout.pixel_stride);
  rgb[1] = at.sample(image.plane[0] + layout.g, image.stride[0], layout.pixel_stride);
  rgb[2] = at.sample(image.plane[0] + layout.b, image.stride[0], layout.pixel_stride);
}

inline size_t rect_offset(const Rect& rect, int x, int y) {
  return static_cast<size_t>(y - rect.y0) * rect.width() + (x - rect.x0);
}

class Contribution {
 public:
  Contribution(const ViewPlan& plan, const FaceIdMap& owners, CameraIndex camera, const Camera& rig_camera)
      : plan_(plan), owners_(owners), corners_(plan, camera), projection_(plan, camera, rig_camera) {}

  float own(int x, int y) const { return corners_.weight_at(plan_, owners_, x, y); }
  bool project(int x, int y, Vec2& pixel) const {
    return projection_.project(plan_.rays().at(x, y), plan_.inverse_at(x, y), pixel);
  }
  // Projects the centre of a chroma sample's four pixels; (x, y) is the first. Positions outside the image are valid.
  bool project_chroma(int x, int y, Vec2& pixel) const {
    return projection_.project_unbounded(plan_.rays().at_centre_of_four(x, y), plan_.inverse_at(x + 0.5, y + 0.5),
                                         pixel);
  }
  // Returns a rectangle that contains all of the camera's pixels.
  Rect rect(CameraIndex camera) const { return corners_.owned(owners_.runs(), plan_.camera_rect(camera)); }

  // Calls fn(x, y, own, valid, position in the camera's image) for the pixels of `rect` with a weight. Returns false if
  // there is none.
  template <class Fn>
  bool for_each(const Rect& rect, const Fn& fn) const {
    bool any = false;
    for (int y = rect.y0; y < rect.y1; y++)
      for (int x = rect.x0; x < rect.x1; x++) {
        const float w = own(x, y);
        if (w == 0) continue;
        any = true;
        Vec2 position;
        const bool valid = project(x, y, position);
        fn(x, y, w, valid, position);
      }
    return any;
  }

 private:
  const ViewPlan& plan_;
  const FaceIdMap& owners_;
  CameraCorners corners_;
  CameraProjection projection_;
};

// Does the same as for_each(), for an I420 image and a chroma-aligned rectangle. Calls luma(index, weight, value) and
// lost(index, weight) per pixel and chroma(index, cb, cr) per chroma sample, with weighted values and indices into
// planes of the rectangle's size. Chroma has the mean valid weight of its (up to four) luma pixels, so that the sum
// over all cameras covers luma and chroma equally.
template <class Luma, class Lost, class Chroma>
bool for_each_i420(const Contribution& contribution, const ImageView& image, const Rect& rect, const Luma& luma,
                   const Lost& lost, const Chroma& chroma) {
  const int chroma_width = chroma_size(rect.width()), chroma_height = chroma_size(rect.height());
  struct Block {
    float weight = 0;
    Vec2 position;  // position of one valid luma sample
  };
  std::vector<Block> blocks(static_cast<size_t>(chroma_width) * chroma_height);
  const bool any = contribution.for_each(rect, [&](int x, int y, float own, bool valid, const Vec2& position) {
    const size_t i = rect_offset(rect, x, y);
    if (!valid) {
      lost(i, own);
      return;
    }
    const Sampler at(position, image.width, image.height);
    luma(i, own, own * at.sample(image.plane[0], image.stride[0], 1));
    Block& block = blocks[static_cast<size_t>((y - rect.y0) / 2) * chroma_width + (x - rect.x0) / 2];
    block.weight += own;
    block.position = position;
  });
  for (int cy = 0; cy < chroma_height; cy++)
    for (int cx = 0; cx < chroma_width; cx++) {
      const size_t i = static_cast<size_t>(cy) * chroma_width + cx;
      if (blocks[i].weight == 0) continue;
      const int x = rect.x0 + 2 * cx, y = rect.y0 + 2 * cy;
      const int pixels = (x + 1 < rect.x1 ? 2 : 1) * (y + 1 < rect.y1 ? 2 : 1);
      const float weight = blocks[i].weight / static_cast<float>(pixels);
      Vec2 position;
      if (!contribution.project_chroma(x, y, position)) position = blocks[i].position;
      const Vec2 chroma_position = (position - 0.5) / 2.0;
      const Sampler at(chroma_position, chroma_size(image.width), chroma_size(image.height));
      chroma(i, weight * (at.sample(image.plane[1], image.stride[1], 1) - 128),
             weight * (at.sample(image.plane[2], image.stride[2], 1) - 128));
    }
  return any;
}

}  // namespace lf::plain

namespace lf {

// One camera's contribution to a view in double precision along the production plan, without rounding: the yardstick
// for SIMD sums in every pixel family and blending mode.
struct FloatFragment {
  PixelFamily family = PixelFamily::kNone;
  Rect rect;                       // chroma-aligned for kI420
  std::vector<float> colour;       // 0..255, weighted, in the layout of Image::data(); chroma without the 128 offset
  std::vector<float> valid, lost;  // weights 0..1 per pixel of `rect`, row-major
};

// `camera` is the index of `rig_camera` in the plan's rig; `owners` covers the camera's rectangle, chroma-aligned for
// kI420. Returns nullopt if the camera has no weight in the view. Throws Error if `image` has another size than the
// camera.
std::optional<FloatFragment> render_float(const ViewPlan& plan, const FaceIdMap& owners, CameraIndex camera,
                                          const Camera& rig_camera, const ImageView& image);

// A view without any rounding to 8 bits: the yardstick for fast renderers and codecs. The error against the rule in
// 80-bit floating point (tests/reference) is below 2e-3 of 255, for I420 images as they are.
struct FloatStill {
  PixelFamily family = PixelFamily::kNone;
  int width = 0, height = 0;
  // 0..255, in the layout of Image::data(), after the division by 1 - lost; chroma with the 128 offset
  std::vector<double> colour;
  std::vector<double> valid, lost;  // sums of weights per pixel, row-major

  std::vector<float> coverage() const { return {valid.begin(), valid.end()}; }
};

// Calls `images` only for contributing cameras. `owners.region()` must be the whole view. Throws Error if an image is
// not of `family`.
FloatStill render_float_still(const Rig& rig, const ViewPlan& plan, const FaceIdMap& owners, PixelFamily family,
                              const CameraImages& images);

// The error of a renderer and codec against exact arithmetic on the same camera images, in the picture's own pixel
// family.
struct ExactQuality {
  double max_error = 0;  // 0..255; rounding the exact picture to 8 bits alone costs up to 0.5
  double psnr_db = 0;    // over all counted samples of the three planes
  double coverage = 0;   // fraction of pixels counted
};

// Counts pixels with coverage above kMinCoverage, and chroma samples with four such pixels. Without any, the figures
// are NaN. Throws Error if families or sizes differ.
ExactQuality compare(const Image& picture, const FloatStill& exact);

}  // namespace lf
