// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <string>

#include <gst/gst.h>
#include <gst/video/video.h>

#include "common/gst_pointers.h"
#include "render/gl/context.h"

typedef struct _GstGLContext GstGLContext;

// Connects the GPU renderer in lib/, which does not depend on GStreamer, with the OpenGL contexts and textures of
// GStreamer. Thread-safe.
namespace lf {

using GlContextPtr = std::shared_ptr<GstGLContext>;
// The reference is weak, because a context may disappear together with its window.
using WeakGlContext = WeakRef<GstGLContext>;

// Returns a number for the share group of a context, which is the set of contexts that can use the same textures. The
// number is valid as long as a context of the group exists.
gl::ShareGroup share_group(GstGLContext* context);

// Creates an OpenGL context for the GPU renderer that shares textures with `context`. The new context does not keep
// `context` alive. On failure, the member `call` of the result is empty, and `why` is set to the reason. The call takes
// tens of milliseconds.
gl::Context::External share(GstGLContext* context, std::string& why);

// Returns true if the picture is in textures that our shaders can access directly, with one texture for each plane.
// Each texture must be as large as its plane, must have one channel for each byte of a pixel, and must allow downloads.
bool has_planes_on_gpu(GstBuffer* picture, const GstVideoInfo& info);
// Returns the share group of the picture's textures. Requires has_planes_on_gpu().
gl::ShareGroup group_of_planes(GstBuffer* picture);

}  // namespace lf
