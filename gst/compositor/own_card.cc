// SPDX-License-Identifier: LGPL-2.1-or-later
#include "compositor/own_card.h"

#include <gst/gl/gl.h>

#include <utility>

namespace lf {

OwnCard::~OwnCard() {
  gst_clear_object(&context_);
  gst_clear_object(&shared_);
  gst_clear_object(&display_);
}

void OwnCard::stop() {
  std::unique_lock lock(mutex_);
  GstGLContext* const context = std::exchange(context_, nullptr);
  lock.unlock();
  if (context) gst_object_unref(context);
}

void OwnCard::share(GstContext* context) {
  const std::lock_guard lock(mutex_);
  gst_gl_handle_set_context(element_, context, &display_, &shared_);
}

bool OwnCard::answer(GstQuery* query) {
  const std::lock_guard lock(mutex_);
  return gst_gl_handle_context_query(element_, query, display_, context_, shared_);
}

// Neighbours are asked without the lock: they may be asking this element.
bool OwnCard::find_context() {
  if (context_) return true;
  GstGLContext* context = nullptr;
  if (!gst_gl_query_local_gl_context(element_, GST_PAD_SRC, &context)) {
    // Whoever is asked answers by share(); where nobody does a display is made here.
    if (!gst_gl_ensure_element_data(element_, &display_, &shared_)) return false;
    GST_OBJECT_LOCK(display_);
    GError* error = nullptr;
    do {
      gst_clear_object(&context);
      context = gst_gl_display_get_gl_context_for_thread(display_, nullptr);
      if (!context && !gst_gl_display_create_context(display_, shared_, &context, &error)) break;
    } while (!gst_gl_display_add_context(display_, context));
    GST_OBJECT_UNLOCK(display_);
    if (error) GST_WARNING_OBJECT(element_, "no OpenGL context: %s", error->message);
    g_clear_error(&error);
  }
  const std::lock_guard lock(mutex_);
  context_ = context;
  return context_ != nullptr;
}

GstBufferPool* OwnCard::pool(GstCaps* caps, guint size) {
  if (!find_context()) return nullptr;
  GstBufferPool* const pool = gst_gl_buffer_pool_new(context_);
  GstStructure* const config = gst_buffer_pool_get_config(pool);
  gst_buffer_pool_config_set_params(config, caps, size, 0, 0);
  gst_buffer_pool_config_add_option(config, GST_BUFFER_POOL_OPTION_VIDEO_META);
  if (gst_buffer_pool_set_config(pool, config)) return pool;
  gst_object_unref(pool);
  return nullptr;
}

}  // namespace lf
