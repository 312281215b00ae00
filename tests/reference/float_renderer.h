// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <optional>
#include <vector>

#include "image/image.h"
#include "render/camera_projection.h"
#include "render/ownership.h"
#include "rig/rig.h"
#include "rig/still_images.h"

// The rule for one camera's part in a view, pixel by pixel: what the plain renderers share, whatever they write.
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
  Contribution(const ViewPlan& plan, const OwnerMap& owners, CameraIndex camera, const Camera& rig_camera)
      : plan_(plan), owners_(owners), corners_(plan, camera), projection_(plan, camera, rig_camera) {}

  float own(int x, int y) const { return corners_.weight_at(plan_, owners_, x, y); }
  bool project(int x, int y, Vec2& pixel) const {
    return projection_.project(plan_.rays().at(x, y), plan_.inverse_at(x, y), pixel);
  }
  // In the middle of the chroma sample's four pixels, of which (x, y) is the first. Positions outside the image are
  // good, too.
  bool project_chroma(int x, int y, Vec2& pixel) const {
    return projection_.project_beyond(plan_.rays().at_centre_of_four(x, y), plan_.inverse_at(x + 0.5, y + 0.5), pixel);
  }
  // Holds all of the camera's pixels.
  Rect rect(CameraIndex camera) const { return corners_.owned(owners_.runs(), plan_.camera_rect(camera)); }

  // Calls fn(x, y, own, valid, position in the camera's image) for the pixels of `rect` with a weight. False if none
  // has.
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
  const OwnerMap& owners_;
  CameraCorners corners_;
  CameraProjection projection_;
};

// The same for an I420 image and a chroma-aligned rectangle. Calls luma(index, weight, value) and lost(index, weight)
// per pixel and chroma(index, cb, cr) per chroma sample, values weighted, indices into planes of the rectangle's size.
// Chroma has the mean valid weight of its (up to four) luma pixels, so that luma and chroma of all cameras together are
// covered alike.
template <class Luma, class Lost, class Chroma>
bool for_each_i420(const Contribution& contribution, const ImageView& image, const Rect& rect, const Luma& luma,
                   const Lost& lost, const Chroma& chroma) {
  const int chroma_width = chroma_size(rect.width()), chroma_height = chroma_size(rect.height());
  struct Block {
    float weight = 0;
    Vec2 position;  // of one valid luma sample
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

// One camera's part in a view, pixel by pixel in double precision along the production plan, rounded nowhere: what the
// SIMD sums are measured against in every family and blending.
struct FloatFragment {
  PixelFamily family = PixelFamily::kNone;
  Rect rect;                       // chroma-aligned for kI420
  std::vector<float> colour;       // 0..255, weighted, laid out as Image::data(); chroma without the 128 offset
  std::vector<float> valid, lost;  // weights 0..1 per pixel of `rect`, row-major
};

// `camera` is `rig_camera`'s index in the rig of the plan, `image` of its size (else Error); `owners` cover the
// camera's rectangle, chroma-aligned for kI420. Nothing if the camera has no weight anywhere in the view.
std::optional<FloatFragment> render_float(const ViewPlan& plan, const OwnerMap& owners, CameraIndex camera,
                                          const Camera& rig_camera, const ImageView& image);

// A view without any rounding to 8 bits on its way: what fast renderers and codecs are measured against. It is within
// 2e-3 of 255 of the rule in 80-bit reals (tests/reference), for I420 images as they are.
struct FloatStill {
  PixelFamily family = PixelFamily::kNone;
  int width = 0, height = 0;
  std::vector<double> colour;  // 0..255, laid out as Image::data(), after the division by 1 - lost; chroma with its 128
  std::vector<double> valid, lost;  // sums of weights per pixel, row-major

  std::vector<float> coverage() const { return {valid.begin(), valid.end()}; }
};

// Asks `images` only for cameras that contribute; all must be of `family` (else Error).
// `owners.region()` is the whole view.
FloatStill render_float_still(const Rig& rig, const ViewPlan& plan, const OwnerMap& owners, PixelFamily family,
                              const CameraImages& images);

// How near a rendered picture is to what exact arithmetic makes of the same camera images: the error of a renderer and
// a codec alone, in the samples of the picture's own family.
struct ExactQuality {
  double max_error = 0;  // 0..255; rounding the exact picture to 8 bits alone costs up to 0.5
  double psnr_db = 0;    // over all samples counted: three planes, as large as they are
  double coverage = 0;   // fraction of pixels counted
};

// Of one family and size (else Error). Counted are pixels with coverage above kCovered, and chroma samples with four of
// them. If none is covered the figures are NaN.
ExactQuality compare(const Image& picture, const FloatStill& exact);

}  // namespace lf
