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

// Rectangles of which no two meet. Of a few each is looked at; of many a bit for each pixel tells, so that what one
// more costs does not depend on how many there are, and never more than a 64th of adding up its pixels. Not
// thread-safe.
class DisjointRects {
 public:
  static constexpr size_t kFew = 32;

  // Whether one of the rectangles has a pixel in `rect`, whose x0 and y0 are at least 0.
  bool meets(const Rect& rect) const;
  // Adds a rectangle; false, and nothing is noted, if it meets another one.
  bool add(const Rect& rect);
  const std::vector<Rect>& rects() const { return rects_; }

 private:
  void mark(const Rect& rect);

  std::vector<Rect> rects_;
  // A bit for each pixel, rows as long as they have to be; used with more than kFew rectangles.
  std::vector<std::vector<uint64_t>> rows_;
};

// Notes where in a view which cameras' contributions have come: nothing may be added twice, and what never came is
// lost. Not thread-safe.
class Coverage {
 public:
  void clear() { *this = {}; }

  // Notes a fragment of one camera. False, and nothing is noted, if it has been there already somewhere in the
  // rectangle.
  bool add(CameraIndex camera, const Rect& rect);

  // The sums of a set of cameras that come in one answer: which of what came before has some of them is looked for once
  // and not for each fragment, of which there may be many of few pixels. While it is there nothing else is added.
  class Sums {
   public:
    // Both are borrowed.
    Sums(Coverage& coverage, const CameraRanges& cameras);
    // As for one camera. False, too, if it is one more set of cameras than kMaxSources.
    bool add(const Rect& rect);

   private:
    Coverage& coverage_;
    const CameraRanges& cameras_;
    std::vector<const DisjointRects*> others_;
    DisjointRects* own_;
  };

  bool has(CameraIndex camera) const;  // whether anything of the camera has come, anywhere in the view
  // Sets to 0 what of `weights`, the camera's weights over `rect` row by row, has come.
  void take_out(CameraIndex camera, const Rect& rect, std::span<float> weights) const;

 private:
  template <typename F>
  void for_each_rect(CameraIndex camera, const F& f) const;

  std::map<CameraIndex, DisjointRects> cameras_;
  std::map<CameraRanges, DisjointRects> sums_;
  CameraRanges summed_;  // cameras of sums_
};

// Pixels of cameras' images as plain fragments bring them, piece by piece, until a view is rendered from them. Memory:
// at most one image of each camera of the rig, pages as pieces touch them. Not thread-safe.
class CameraPixels {
 public:
  void clear() { cameras_.clear(); }

  // Copies a piece of the image of `camera`, of which the rig says `rig_camera`. False if it does not lie inside the
  // image, meets another piece of it or is of another family.
  bool add(CameraIndex camera, const Camera& rig_camera, const FragmentPlanes& piece);

  // Cameras of which there is something, ascending.
  std::vector<CameraIndex> cameras() const;
  // Whether all of `region` has come.
  bool has(CameraIndex camera, const Rect& region) const;
  // The whole image, of which what has come is defined and the rest may be read; until clear().
  ImageView image(CameraIndex camera) const { return cameras_.at(camera).image; }

 private:
  struct Pixels {
    ImageView image;
    PooledBuffer memory;
    std::vector<Rect> pieces;  // rectangles of the image that have come; they are disjoint
  };
  std::map<CameraIndex, Pixels> cameras_;
};

}  // namespace lf
