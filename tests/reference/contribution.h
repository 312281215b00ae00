// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <optional>
#include <vector>

#include "render/camera_projection.h"
#include "render/ownership.h"
#include "render/sampler.h"

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
