// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <string>

#include <gst/gst.h>
#include <gst/video/video.h>

#include "render/gl/context.h"

typedef struct _GstGLContext GstGLContext;

// Lets the renderers in lib/ use OpenGL contexts and textures of GStreamer. Thread-safe.
namespace lf {

using GlContextPtr = std::shared_ptr<GstGLContext>;

// A weak reference to a context, because the context may disappear together with its window.
class WeakGlContext {
 public:
  WeakGlContext() = default;
  explicit WeakGlContext(GstGLContext* context);
  GlContextPtr get() const;

 private:
  std::shared_ptr<GWeakRef> ref_;
};

// Returns the share group of a context, the set of contexts that share textures. A group ends with its last context.
gl::ShareGroup share_group(GstGLContext* context);

// Creates a context that shares textures with `context` without keeping it alive. On failure, `call` of the result is
// empty and `why` has the reason. Takes tens of milliseconds.
gl::Context::External share(GstGLContext* context, std::string& why);

// Returns true if the buffer is a picture in textures that shaders can read plane by plane. Each texture must have one
// channel per byte of a pixel, at least the size of the plane, and a way to download.
bool has_planes_on_gpu(GstBuffer* picture, const GstVideoInfo& info);
gl::ShareGroup group_of_planes(GstBuffer* picture);

}  // namespace lf
