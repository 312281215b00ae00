// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <mutex>

#include <gst/gst.h>

#include "common/custom_events.h"

typedef struct _GstGLContext GstGLContext;
typedef struct _GstGLDisplay GstGLDisplay;

namespace lf {

// Provides GPU memory for pictures. It is needed if downstream requires GPU memory but offers no pool, as gldownload
// does. Uses an OpenGL context shared by neighbours, or creates its own, as OpenGL sources do.
class OwnGpu {
 public:
  explicit OwnGpu(GstElement* element) : element_(element) {}
  ~OwnGpu();
  OwnGpu(const OwnGpu&) = delete;
  OwnGpu& operator=(const OwnGpu&) = delete;

  // Returns a pool for pictures of these caps, `size` bytes each (transfer full). Returns null if there is no OpenGL.
  // Streaming thread.
  GstBufferPool* pool(GstCaps* caps, guint size);
  // Releases the context. Call from the streaming thread or while it is stopped.
  void stop();

  // Implements GstElementClass::set_context: an application or a neighbour sets the display and the context to share.
  // Any thread.
  void share(GstContext* context);
  // Answers context queries of neighbours. Returns false if the query is not handled. Any thread.
  bool answer(GstQuery* query);

 private:
  bool find_context();

  GstElement* const element_;
  std::mutex mutex_;  // guards the members below
  GstGLDisplay* display_ = nullptr;
  GstGLContext *shared_ = nullptr, *context_ = nullptr;
};

// Provides and recycles the memory of pictures. Pictures may outlive the pool. Not thread-safe.
class PicturePool {
 public:
  static constexpr guint kMostIdle = 4;  // idle buffers kept for the next pictures

  PicturePool() = default;
  ~PicturePool() { clear(); }
  PicturePool(const PicturePool&) = delete;
  PicturePool& operator=(const PicturePool&) = delete;

  // Implements GstAggregatorClass::decide_allocation: selects the pool for raw video and makes it the first pool of the
  // query. Prefers a suitable pool of downstream. Otherwise uses an own pool, or a pool of `gpu` for GPU memory (see
  // is_in_gpu()). Returns false if there is no memory. *context becomes the OpenGL context of the memory, or null for
  // system memory.
  bool decide(GstQuery* query, OwnGpu* gpu = nullptr, GlContextPtr* context = nullptr);
  // Returns a buffer of `chosen`, the pool that decide() selected (transfer full). Never blocks, because pictures are
  // kept for repetition: if `chosen` is exhausted, an own pool provides the buffer. Returns null if there is no memory.
  GstBuffer* take(GstBufferPool* chosen);
  void clear();

 private:
  GstBufferPool* own_ = nullptr;
};

}  // namespace lf
