// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <string>

#include <gst/gst.h>
#include <gst/video/video.h>

#include "render/gl/context.h"

typedef struct _GstGLContext GstGLContext;

// GStreamer's OpenGL contexts, and pictures in their textures, as lib/ knows them. Thread-safe.
namespace lf {

using GlContextPtr = std::shared_ptr<GstGLContext>;

// A context that may go at any time, as does the window that it belongs to.
class WeakGlContext {
 public:
  WeakGlContext() = default;  // none
  explicit WeakGlContext(GstGLContext* context);
  // Null once it is gone.
  GlContextPtr get() const;

 private:
  std::shared_ptr<GWeakRef> ref_;
};

// The number of the contexts that share with this one. One that is gone is forgotten, and with the last one its number.
gl::ShareGroup share_group(GstGLContext* context);

// A new context that shares with that one, and does not keep it; `call` of it is empty, with the reason in `why`, if
// none can be had. Takes tens of milliseconds.
gl::Context::Foreign share(GstGLContext* context, std::string& why);

// Whether the buffer is a picture of this video in textures that shaders can take plane by plane: with a channel for
// each byte of a plane's pixels, of at least the plane's size, and with a way to this process's memory.
bool has_planes_on_card(GstBuffer* picture, const GstVideoInfo& info);
// The contexts that share the textures of such a picture.
gl::ShareGroup group_of_planes(GstBuffer* picture);

}  // namespace lf
