// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

namespace lf {

// Memory of pictures that downstream has let go of: a 1080p picture on pages fresh from the system costs as much as
// making it. Not thread-safe; pictures may outlive it.
class PicturePool {
 public:
  PicturePool() = default;
  ~PicturePool() { clear(); }
  PicturePool(const PicturePool&) = delete;
  PicturePool& operator=(const PicturePool&) = delete;

  // For pictures of these caps from now on. False if there is no memory.
  bool configure(GstCaps* caps, gsize size);
  // Owned by the caller; null if there is no memory.
  GstBuffer* take();
  void clear();

 private:
  GstBufferPool* pool_ = nullptr;
};

}  // namespace lf
