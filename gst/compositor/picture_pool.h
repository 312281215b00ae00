// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

namespace lf {

// Memory of pictures that downstream has let go of: a 1080p picture on pages fresh from the system costs as much as
// making it. Not thread-safe; pictures may outlive it.
class PicturePool {
 public:
  static constexpr guint kMostIdle = 4;  // pictures that are kept for the next; those of a burst are not

  PicturePool() = default;
  ~PicturePool() { clear(); }
  PicturePool(const PicturePool&) = delete;
  PicturePool& operator=(const PicturePool&) = delete;

  // For GstAggregatorClass::decide_allocation, of raw video: the first pool of the query is where pictures are to come
  // from, downstream's own if it offers one that serves, else one of ours. False if there is no memory.
  bool decide(GstQuery* query);
  // From `chosen`, the pool that came of that. Nobody waits for one that has run out, as pictures are kept here to be
  // shown again: what is missing then is ours. Owned by the caller; null if there is no memory.
  GstBuffer* take(GstBufferPool* chosen);
  void clear();

 private:
  GstBufferPool* own_ = nullptr;
};

}  // namespace lf
