// SPDX-License-Identifier: LGPL-2.1-or-later
// Replaces GStreamer's OpenGL library in builds with the option gl=disabled. There is no GPU memory and no context, so
// the elements use system memory only.
#pragma once

#include <gst/gst.h>
#include <gst/video/video.h>

typedef struct _GstGLContext {
  GstObject parent;
  GstObject* display;
} GstGLContext;
typedef struct _GstGLDisplay GstGLDisplay;
typedef struct {
  struct {
    GstGLContext* context;
  } mem;
} GstGLMemory;
typedef struct {
  GstGLContext* context;
} GstGLBufferPool, GstGLSyncMeta;
typedef enum {
  GST_GL_RED,
  GST_GL_R8,
  GST_GL_RG,
  GST_GL_RG8,
  GST_GL_RGB,
  GST_GL_RGB8,
  GST_GL_RGBA,
  GST_GL_RGBA8
} GstGLFormat;
enum { GST_GL_API_GLES2, GST_GL_TEXTURE_TARGET_2D };

#define GST_MAP_GL 0
#define GST_TYPE_GL_CONTEXT GST_TYPE_OBJECT
#define GST_GL_CONTEXT(object) reinterpret_cast<GstGLContext*>(object)
#define GST_GL_BUFFER_POOL(pool) reinterpret_cast<GstGLBufferPool*>(pool)
#define GST_IS_GL_BUFFER_POOL(pool) (static_cast<void>(pool), FALSE)
#define GST_GL_SYNC_META_API_TYPE GST_VIDEO_META_API_TYPE
G_DEFINE_AUTOPTR_CLEANUP_FUNC(GstGLContext, gst_object_unref)

inline gboolean gst_is_gl_memory(GstMemory*) { return FALSE; }
inline GstGLFormat gst_gl_memory_get_texture_format(GstGLMemory*) { return GST_GL_RGBA; }
inline int gst_gl_memory_get_texture_target(GstGLMemory*) { return GST_GL_TEXTURE_TARGET_2D; }
inline gint gst_gl_memory_get_texture_width(GstGLMemory*) { return 0; }
inline gint gst_gl_memory_get_texture_height(GstGLMemory*) { return 0; }
inline GstGLContext* gst_gl_context_new(GstObject*) { return nullptr; }
inline gboolean gst_gl_context_create(GstGLContext*, GstGLContext*, GError**) { return FALSE; }
inline gboolean gst_gl_context_can_share(GstGLContext*, GstGLContext*) { return FALSE; }
inline GstGLContext* gst_gl_context_get_current() { return nullptr; }
inline int gst_gl_context_get_gl_api(GstGLContext*) { return GST_GL_API_GLES2; }
inline void gst_gl_context_thread_add(GstGLContext*, void (*)(GstGLContext*, gpointer), gpointer) {}
inline void gst_gl_handle_set_context(GstElement*, GstContext*, GstGLDisplay**, GstGLContext**) {}
inline gboolean gst_gl_handle_context_query(GstElement*, GstQuery*, GstGLDisplay*, GstGLContext*, GstGLContext*) {
  return FALSE;
}
inline gboolean gst_gl_query_local_gl_context(GstElement*, GstPadDirection, GstGLContext**) { return FALSE; }
inline gboolean gst_gl_ensure_element_data(GstElement*, GstGLDisplay**, GstGLContext**) { return FALSE; }
inline GstGLContext* gst_gl_display_get_gl_context_for_thread(GstGLDisplay*, GThread*) { return nullptr; }
inline gboolean gst_gl_display_create_context(GstGLDisplay*, GstGLContext*, GstGLContext**, GError**) { return FALSE; }
inline gboolean gst_gl_display_add_context(GstGLDisplay*, GstGLContext*) { return TRUE; }
inline GstBufferPool* gst_gl_buffer_pool_new(GstGLContext*) { return nullptr; }
inline GstGLSyncMeta* gst_buffer_get_gl_sync_meta(GstBuffer*) { return nullptr; }
inline GstGLSyncMeta* gst_buffer_add_gl_sync_meta(GstGLContext*, GstBuffer*) { return nullptr; }
inline void gst_gl_sync_meta_wait(GstGLSyncMeta*, GstGLContext*) {}
inline void gst_gl_sync_meta_set_sync_point(GstGLSyncMeta*, GstGLContext*) {}
