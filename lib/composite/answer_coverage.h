// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "base/maths.h"
#include "base/memory.h"
#include "image/image.h"
#include "render/sum_planes.h"
#include "rig/rig.h"

namespace lf {

// A set of disjoint rectangles. A few are compared one by one; many are marked in a bitmap. An addition therefore costs
// at most a 64th of adding up the pixels, for any number of rectangles. Not thread-safe.
class DisjointRects {
 public:
  static constexpr size_t kFew = 32;

  // True if a rectangle overlaps `rect`. Requires rect.x0, rect.y0 >= 0.
  bool meets(const Rect& rect) const;
  // Returns false and adds nothing if `rect` overlaps another rectangle.
  bool add(const Rect& rect);
  const std::vector<Rect>& rects() const { return rects_; }

 private:
  void mark(const Rect& rect);

  std::vector<Rect> rects_;
  // Bitmap with rows of varying length; used for more than kFew rectangles.
  std::vector<std::vector<uint64_t>> rows_;
};

// Records which cameras have contributed where in a view. A contribution must not be added twice, and a contribution
// that never arrives is missing weight. Not thread-safe.
class Coverage {
 public:
  void clear() { *this = {}; }

  // Records a fragment of one camera. Returns false and records nothing if the camera has already contributed inside
  // the rectangle.
  bool add(CameraIndex camera, const Rect& rect);

  // The sums of a set of cameras in one answer. Finds the overlapping camera sets once per answer instead of once per
  // fragment, because an answer may have many small fragments. Nothing else may be added during its lifetime.
  class Sums {
   public:
    // Keeps references to both arguments.
    Sums(Coverage& coverage, const CameraRanges& cameras);
    // As for one camera. Also returns false for a new camera set beyond kMaxSources.
    bool add(const Rect& rect);

   private:
    Coverage& coverage_;
    const CameraRanges& cameras_;
    std::vector<const DisjointRects*> others_;
    DisjointRects* own_;
  };

  bool has(CameraIndex camera) const;
  // Sets the received part of `weights` to 0. `weights`: the camera's weights over `rect`, row by row.
  void subtract(CameraIndex camera, const Rect& rect, std::span<float> weights) const;

 private:
  template <typename F>
  void for_each_rect(CameraIndex camera, const F& f) const;

  std::map<CameraIndex, DisjointRects> cameras_;
  std::map<CameraRanges, DisjointRects> sums_;
  CameraRanges summed_;
};

// Camera images assembled from unwarped fragments. Memory: at most one image per camera of the rig; the system
// allocates pages on first use. Not thread-safe.
class CameraPixels {
 public:
  void clear() { cameras_.clear(); }

  // Copies a piece of a camera's image. Returns false if the piece is not inside the image, overlaps another piece, or
  // has another pixel family.
  bool add(CameraIndex camera, const Camera& rig_camera, const FragmentPlanes& piece);

  std::vector<CameraIndex> cameras() const;
  bool has(CameraIndex camera, const Rect& region) const;
  // Returns the whole image, valid until clear(). Parts that have not arrived are readable but undefined.
  ImageView image(CameraIndex camera) const { return cameras_.at(camera).image; }

 private:
  struct Pixels {
    ImageView image;
    PooledBuffer memory;
    std::vector<Rect> pieces;  // disjoint
  };
  std::map<CameraIndex, Pixels> cameras_;
};

}  // namespace lf
