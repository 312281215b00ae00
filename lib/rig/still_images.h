// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <functional>
#include <list>
#include <unordered_map>

#include "image/image.h"
#include "rig/rig.h"

namespace lf {

// Gives the image of a camera; the reference stays valid until the next call. May throw Error.
using CameraImages = std::function<const Image&(CameraIndex)>;

// Whether every camera names a still.
bool has_images(const Rig& rig);

// The `image` files of a rig's cameras, in the colours that their `colour` corrects them to, read when first asked for
// and kept as long as there is room. Not thread-safe.
class StillImages {
 public:
  static constexpr size_t kDefaultRoom = size_t{1} << 30;  // bytes

  // `rig` must outlive this. `family`: what get() gives. `room`: bytes of images to keep; one is kept in any case.
  explicit StillImages(const Rig& rig, PixelFamily family = PixelFamily::kRgb, size_t room = kDefaultRoom)
      : rig_(rig), family_(family), room_(room) {}

  // Valid until the next call. Throws Error naming the camera and the file: no image named, none there, one that can't
  // be read or is not of the rig's size.
  const Image& get(CameraIndex camera);

 private:
  struct Kept {
    CameraIndex camera;
    Image image;
  };
  const Rig& rig_;
  PixelFamily family_;
  size_t room_, used_ = 0;
  std::list<Kept> kept_;  // the one asked for last in front
  std::unordered_map<CameraIndex, std::list<Kept>::iterator> place_;
};

}  // namespace lf
