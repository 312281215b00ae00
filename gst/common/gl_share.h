// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <string>

#include <gst/gst.h>

#include "render/gl/context.h"

typedef struct _GstGLContext GstGLContext;

// GStreamer's OpenGL contexts as lib/ knows them. Thread-safe.
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

}  // namespace lf
