// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gl/gl.h>

namespace lf {

// Who has written a picture in another context than its textures' own says when that is done: their own, which is
// returned, goes on after it. `picture` is in GstGLMemory.
inline GstGLContext* wait_for_writer(GstBuffer* picture) {
  GstGLContext* const context = reinterpret_cast<GstGLMemory*>(gst_buffer_peek_memory(picture, 0))->mem.context;
  if (GstGLSyncMeta* const written = gst_buffer_get_gl_sync_meta(picture)) gst_gl_sync_meta_wait(written, context);
  return context;
}

}  // namespace lf
