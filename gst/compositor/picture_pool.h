// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <mutex>

#include <gst/gst.h>

#include "common/custom_events.h"

typedef struct _GstGLContext GstGLContext;
typedef struct _GstGLDisplay GstGLDisplay;

namespace lf {

// Memory for pictures in a graphics card where downstream takes them there and offers none, as gldownload does: of an
// OpenGL context that neighbours share, or of the element's own, as sources of OpenGL have one.
class OwnCard {
 public:
  explicit OwnCard(GstElement* element) : element_(element) {}
  ~OwnCard();
  OwnCard(const OwnCard&) = delete;
  OwnCard& operator=(const OwnCard&) = delete;

  // A pool for pictures of these caps, `size` bytes each, owned by the caller; null if there is no OpenGL. Streaming
  // thread.
  GstBufferPool* pool(GstCaps* caps, guint size);
  // Lets go of the context. Streaming thread, or when there is none.
  void stop();

  // What GstElementClass::set_context does: an application or a neighbour says which display and context to share. Any
  // thread.
  void share(GstContext* context);
  // Answers neighbours that ask for a context to share. False: it is not for this element to say. Any thread.
  bool answer(GstQuery* query);

 private:
  bool find_context();

  GstElement* const element_;
  std::mutex mutex_;  // of what is below
  GstGLDisplay* display_ = nullptr;
  GstGLContext *shared_ = nullptr, *context_ = nullptr;
};

// Memory of pictures that downstream has let go of: a 1080p picture on pages fresh from the system costs as much as
// making it. Not thread-safe; pictures may outlive it.
class PicturePool {
 public:
  static constexpr guint kMostIdle = 4;  // pictures that are kept for the next; those of a burst are not

  PicturePool() = default;
  ~PicturePool() { clear(); }
  PicturePool(const PicturePool&) = delete;
  PicturePool& operator=(const PicturePool&) = delete;

  // Decides on the pool that pictures of raw video come from, in GstAggregatorClass::decide_allocation: it becomes the
  // first one of the query, downstream's own if it offers one that serves, else one of ours, in a graphics card (see
  // is_in_card()) one of `card`. False if there is no memory. `context`: becomes the one that the pool's memory belongs
  // to, null if that is not a card's.
  bool decide(GstQuery* query, OwnCard* card = nullptr, GlContextPtr* context = nullptr);
  // A buffer of `chosen`, the pool that decide() decided on, owned by the caller; null if there is no memory. Where
  // that pool has run out the buffer is one of ours, as pictures are kept to be shown again and nobody may wait for
  // them.
  GstBuffer* take(GstBufferPool* chosen);
  void clear();

 private:
  GstBufferPool* own_ = nullptr;
};

}  // namespace lf
