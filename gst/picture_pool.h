// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

namespace lf {

// Memory of pictures that downstream has let go of: a 1080p picture on pages fresh from the system costs as much as
// making it. Downstream's own pool is used where it offers one that can't run out. Not thread-safe; pictures may
// outlive it.
class PicturePool {
 public:
  static constexpr int kMostIdle = 4;  // pictures that are kept for the next; those of a burst are not

  PicturePool() = default;
  ~PicturePool() { clear(); }
  PicturePool(const PicturePool&) = delete;
  PicturePool& operator=(const PicturePool&) = delete;

  // For pictures of these caps from now on, which leave by `src`; asks downstream. False if there is no memory.
  bool configure(GstPad* src, GstCaps* caps, gsize size);
  // Owned by the caller; null if there is no memory.
  GstBuffer* take();
  void clear();

 private:
  GstBufferPool* pool_ = nullptr;
};

}  // namespace lf
