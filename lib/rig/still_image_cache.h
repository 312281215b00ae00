// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <functional>
#include <list>
#include <string>
#include <unordered_map>

#include "image/image.h"
#include "rig/rig.h"

namespace lf {

// Returns the image of a camera. The reference is valid until the next call. May throw Error.
using CameraImages = std::function<const Image&(CameraIndex)>;

bool has_images(const Rig& rig);

// Returns a notice if images of a rig have an EXIF orientation, which the library ignores; otherwise "". The notice
// names the first of these images and counts the rest. Reads the first 64 KiB of each image and skips unreadable files.
std::string orientation_notice(const Rig& rig);

// Loads the image files of a rig's cameras on first use, applies their colour correction, and keeps the results in a
// cache. Not thread-safe.
class StillImageCache {
 public:
  static constexpr size_t kDefaultCacheBytes = size_t{1} << 30;

  // Creates an empty cache. `rig` must outlive this object. `family` is the pixel family of the images. `room` is the
  // maximum size of the cache in bytes, but at least one image is kept.
  explicit StillImageCache(const Rig& rig, PixelFamily family = PixelFamily::kRgb, size_t room = kDefaultCacheBytes)
      : rig_(rig), family_(family), room_(room) {}

  // Returns the image of a camera, which is valid until the next call. Throws Error with the camera and the file if the
  // rig has no image for the camera, or if the file is missing, unreadable or of the wrong size.
  const Image& get(CameraIndex camera);

 private:
  struct CacheEntry {
    CameraIndex camera;
    Image image;
  };
  const Rig& rig_;
  PixelFamily family_;
  size_t room_, used_ = 0;
  std::list<CacheEntry> cache_;
  std::unordered_map<CameraIndex, std::list<CacheEntry>::iterator> place_;
};

}  // namespace lf
