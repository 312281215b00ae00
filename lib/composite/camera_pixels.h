// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <map>
#include <vector>

#include "image/image.h"
#include "jpeg/buffer_pool.h"
#include "render/fragment_planes.h"
#include "rig/rig.h"

namespace lf {

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
    jpeg::PooledBuffer memory;
    std::vector<Rect> pieces;  // disjoint
  };
  std::map<CameraIndex, Pixels> cameras_;
};

}  // namespace lf
