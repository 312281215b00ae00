// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <mutex>

#include <gst/gst.h>

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

}  // namespace lf
