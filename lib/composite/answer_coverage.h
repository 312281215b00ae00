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

// A set of rectangles that do not overlap: the parts of a view that have been received. A new rectangle that overlaps
// one of them is a repetition or a forgery, and must not be added twice. A few rectangles are compared one by one; for
// more than kFew rectangles, the class uses a bitmap, so that many small rectangles do not take quadratic time. Not
// thread-safe.
class DisjointRects {
 public:
  static constexpr size_t kFew = 32;

  // Returns true if any rectangle of the set overlaps `rect`, which must not have negative coordinates.
  bool meets(const Rect& rect) const;
  // Returns false and adds nothing if `rect` overlaps another rectangle.
  bool add(const Rect& rect);
  const std::vector<Rect>& rects() const { return rects_; }

 private:
  void mark(const Rect& rect);

  std::vector<Rect> rects_;
  // Bitmap with rows of varying length, used for more than kFew rectangles.
  std::vector<std::vector<uint64_t>> rows_;
};

// Records which cameras have contributed to each part of a view. The compositor can therefore reject repeated
// contributions, and compute the missing weight of incomplete cameras. Not thread-safe.
class Coverage {
 public:
  void clear() { *this = {}; }

  // Records a fragment of one camera. Returns false and records nothing if the camera has already contributed inside
  // the rectangle.
  bool add(CameraIndex camera, const Rect& rect);

  // Records the fragments of one answer that are sums over several cameras. These fragments have the same set of
  // cameras, so overlaps with other answers can be prepared once. While this object exists, record only through this
  // object.
  class Sums {
   public:
    Sums(Coverage& coverage, const CameraRanges& cameras);
    // Records a rectangle of the answer. Returns false and records nothing if one of the answer's cameras has already
    // contributed inside the rectangle. Also returns false if the set of cameras is new and there are kMaxSources sets
    // already.
    bool add(const Rect& rect);

   private:
    Coverage& coverage_;
    const CameraRanges& cameras_;
    std::vector<const DisjointRects*> others_;
    DisjointRects* own_;
  };

  bool has(CameraIndex camera) const;
  // Leaves only the weight that is still missing from a camera: sets `weights` to 0 in the pixels that the camera has
  // already contributed. `weights` are the camera's blending weights over `rect`, row by row.
  void subtract(CameraIndex camera, const Rect& rect, std::span<float> weights) const;

 private:
  template <typename F>
  void for_each_rect(CameraIndex camera, const F& f) const;

  std::map<CameraIndex, DisjointRects> cameras_;
  std::map<CameraRanges, DisjointRects> sums_;
  CameraRanges summed_;
};

// Assembles images of cameras that cannot render and therefore send parts of their original image. Uses at most one
// image of memory per camera of the rig; the system allocates the pages of an image on first use. Not thread-safe.
class CameraPixels {
 public:
  void clear() { cameras_.clear(); }

  // Copies a piece of a camera's image. Returns false if the piece is not inside the image, overlaps another piece, or
  // has another pixel family.
  bool add(CameraIndex camera, const Camera& rig_camera, const FragmentPlanes& piece);

  std::vector<CameraIndex> cameras() const;
  bool has(CameraIndex camera, const Rect& region) const;
  // Returns the whole image, valid until clear(). Pixels that have not arrived are undefined, but may be read.
  ImageView image(CameraIndex camera) const { return cameras_.at(camera).image; }

 private:
  struct Pixels {
    ImageView image;
    PooledBuffer memory;
    std::vector<Rect> pieces;
  };
  std::map<CameraIndex, Pixels> cameras_;
};

}  // namespace lf
