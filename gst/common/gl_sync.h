// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gl/gl.h>

namespace lf {

// Call this before reading textures that another OpenGL context may have written. The function makes the context of the
// textures wait until the writes are complete, and returns this context. `picture` must consist of GstGLMemory.
inline GstGLContext* wait_for_gl_writer(GstBuffer* picture) {
  GstGLContext* const context = reinterpret_cast<GstGLMemory*>(gst_buffer_peek_memory(picture, 0))->mem.context;
  if (GstGLSyncMeta* const written = gst_buffer_get_gl_sync_meta(picture)) gst_gl_sync_meta_wait(written, context);
  return context;
}

}  // namespace lf
