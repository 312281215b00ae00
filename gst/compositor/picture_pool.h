// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <mutex>

#include <gst/gst.h>

#include "common/custom_events.h"

typedef struct _GstGLContext GstGLContext;
typedef struct _GstGLDisplay GstGLDisplay;

namespace lf {

// Allocates pictures in GPU memory for elements that require GPU memory but offer no buffer pool, such as gldownload.
// The class uses the OpenGL context of a neighbouring element, if possible. Otherwise it creates a context, as the
// OpenGL sources of GStreamer do.
class OwnGpu {
 public:
  explicit OwnGpu(GstElement* element) : element_(element) {}
  ~OwnGpu();
  OwnGpu(const OwnGpu&) = delete;
  OwnGpu& operator=(const OwnGpu&) = delete;

  // Returns a buffer pool for pictures with these caps and `size` bytes each, which the caller owns. Returns null if
  // OpenGL is not available. Streaming thread.
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

// Chooses the buffer pool of the output, and provides the buffers of the pictures. It is needed because a compositor
// keeps pictures for repetition, so a small pool of downstream would run empty and block. Pictures may outlive this
// object. Not thread-safe.
class PicturePool {
 public:
  static constexpr guint kMaxIdle = 4;  // idle buffers kept for the next pictures

  PicturePool() = default;
  ~PicturePool() { clear(); }
  PicturePool(const PicturePool&) = delete;
  PicturePool& operator=(const PicturePool&) = delete;

  // Implements GstAggregatorClass::decide_allocation for raw video: selects a pool and makes it the first pool of the
  // query. The function prefers a suitable pool of downstream. Otherwise it creates a pool: `gpu` provides it for caps
  // in GPU memory. Sets *context to the OpenGL context of the memory, or to null for system memory. Returns false if no
  // pool can be created.
  bool decide(GstQuery* query, OwnGpu* gpu = nullptr, GlContextPtr* context = nullptr);
  // Returns a new buffer, which the caller owns, from the pool `chosen` that decide() has selected. Never blocks: if
  // all buffers of `chosen` are in use, the buffer comes from a second pool without a maximum. Returns null if there is
  // no memory.
  GstBuffer* take(GstBufferPool* chosen);
  void clear();

 private:
  GstBufferPool* own_ = nullptr;
};

}  // namespace lf
