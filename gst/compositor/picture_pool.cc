// SPDX-License-Identifier: LGPL-2.1-or-later
#include "compositor/picture_pool.h"

#include <utility>

#include <gst/gl/gl.h>
#include <gst/video/gstvideopool.h>

#include "compositor/picture_output.h"

namespace {

// A video buffer pool that shrinks: it keeps a few idle buffers and frees further returned buffers.
struct LfTrimmingPool {
  GstVideoBufferPool parent;
  gint buffers, in_use;
};
struct LfTrimmingPoolClass {
  GstVideoBufferPoolClass parent_class;
};

G_DEFINE_TYPE(LfTrimmingPool, lf_trimming_pool, GST_TYPE_VIDEO_BUFFER_POOL)

LfTrimmingPool* trimming_pool(GstBufferPool* pool) { return reinterpret_cast<LfTrimmingPool*>(pool); }

GstBufferPoolClass* base_class() { return GST_BUFFER_POOL_CLASS(lf_trimming_pool_parent_class); }

GstFlowReturn alloc(GstBufferPool* pool, GstBuffer** buffer, GstBufferPoolAcquireParams* params) {
  const GstFlowReturn flow = base_class()->alloc_buffer(pool, buffer, params);
  if (flow == GST_FLOW_OK) g_atomic_int_inc(&trimming_pool(pool)->buffers);
  return flow;
}

void free_buffer(GstBufferPool* pool, GstBuffer* buffer) {
  g_atomic_int_add(&trimming_pool(pool)->buffers, -1);
  base_class()->free_buffer(pool, buffer);
}

GstFlowReturn acquire(GstBufferPool* pool, GstBuffer** buffer, GstBufferPoolAcquireParams* params) {
  const GstFlowReturn flow = base_class()->acquire_buffer(pool, buffer, params);
  if (flow == GST_FLOW_OK) g_atomic_int_inc(&trimming_pool(pool)->in_use);
  return flow;
}

void release(GstBufferPool* pool, GstBuffer* buffer) {
  LfTrimmingPool* self = trimming_pool(pool);
  const gint in_use = g_atomic_int_add(&self->in_use, -1) - 1;
  if (g_atomic_int_get(&self->buffers) - in_use > static_cast<gint>(lf::PicturePool::kMaxIdle))
    GST_BUFFER_FLAG_SET(buffer, GST_BUFFER_FLAG_TAG_MEMORY);
  base_class()->release_buffer(pool, buffer);
}

void lf_trimming_pool_class_init(LfTrimmingPoolClass* klass) {
  GstBufferPoolClass* pool_class = GST_BUFFER_POOL_CLASS(klass);
  pool_class->alloc_buffer = alloc;
  pool_class->free_buffer = free_buffer;
  pool_class->acquire_buffer = acquire;
  pool_class->release_buffer = release;
}

void lf_trimming_pool_init(LfTrimmingPool*) {}

struct Memory {
  GstAllocator* allocator = nullptr;
  GstAllocationParams params;
  bool has_video_meta = false;  // downstream reads plane offsets from the meta
};

// Ignores custom allocators of downstream, because they only work with their own pool.
Memory memory_of(GstQuery* query) {
  Memory memory;
  gst_allocation_params_init(&memory.params);
  if (gst_query_get_n_allocation_params(query) > 0)
    gst_query_parse_nth_allocation_param(query, 0, &memory.allocator, &memory.params);
  if (memory.allocator && GST_OBJECT_FLAG_IS_SET(memory.allocator, GST_ALLOCATOR_FLAG_CUSTOM_ALLOC))
    gst_clear_object(&memory.allocator);
  memory.has_video_meta = gst_query_find_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr);
  return memory;
}

// A pool may adjust the configuration. The adjusted configuration must then be set again.
bool configure(GstBufferPool* pool, GstCaps* caps, guint size, guint least, guint most, const Memory& memory) {
  GstStructure* config = gst_buffer_pool_get_config(pool);
  gst_buffer_pool_config_set_params(config, caps, size, least, most);
  gst_buffer_pool_config_set_allocator(config, memory.allocator, &memory.params);
  if (memory.has_video_meta && gst_buffer_pool_has_option(pool, GST_BUFFER_POOL_OPTION_VIDEO_META))
    gst_buffer_pool_config_add_option(config, GST_BUFFER_POOL_OPTION_VIDEO_META);
  if (gst_buffer_pool_set_config(pool, config)) return true;
  config = gst_buffer_pool_get_config(pool);
  if (gst_buffer_pool_config_validate_params(config, caps, size, least, most))
    return gst_buffer_pool_set_config(pool, config);
  gst_structure_free(config);
  return false;
}

}  // namespace

namespace lf {

OwnGpu::~OwnGpu() {
  gst_clear_object(&context_);
  gst_clear_object(&shared_);
  gst_clear_object(&display_);
}

void OwnGpu::stop() {
  std::unique_lock lock(mutex_);
  GstGLContext* const context = std::exchange(context_, nullptr);
  lock.unlock();
  if (context) gst_object_unref(context);
}

void OwnGpu::share(GstContext* context) {
  const std::lock_guard lock(mutex_);
  gst_gl_handle_set_context(element_, context, &display_, &shared_);
}

bool OwnGpu::answer(GstQuery* query) {
  const std::lock_guard lock(mutex_);
  return gst_gl_handle_context_query(element_, query, display_, context_, shared_);
}

// Queries neighbours without the lock, because they may be querying this element at the same time.
bool OwnGpu::find_context() {
  if (context_) return true;
  GstGLContext* context = nullptr;
  if (!gst_gl_query_local_gl_context(element_, GST_PAD_SRC, &context)) {
    // Neighbours answer by calling share(). If none does, this element creates a display.
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

GstBufferPool* OwnGpu::pool(GstCaps* caps, guint size) {
  if (!find_context()) return nullptr;
  GstBufferPool* const pool = gst_gl_buffer_pool_new(context_);
  GstStructure* const config = gst_buffer_pool_get_config(pool);
  gst_buffer_pool_config_set_params(config, caps, size, 0, 0);
  gst_buffer_pool_config_add_option(config, GST_BUFFER_POOL_OPTION_VIDEO_META);
  if (gst_buffer_pool_set_config(pool, config)) return pool;
  gst_object_unref(pool);
  return nullptr;
}

bool PicturePool::decide(GstQuery* query, OwnGpu* gpu, GlContextPtr* context) {
  clear();
  GstCaps* caps = nullptr;
  gst_query_parse_allocation(query, &caps, nullptr);
  GstVideoInfo info;
  if (!caps || !gst_video_info_from_caps(&info, caps)) return false;
  const guint size = static_cast<guint>(info.size);
  Memory memory = memory_of(query);
  const bool may_be_own = !is_in_gpu(caps);
  if (may_be_own) own_ = GST_BUFFER_POOL(gst_object_ref_sink(g_object_new(lf_trimming_pool_get_type(), nullptr)));
  const bool has_own = may_be_own && configure(own_, caps, size, 0, 0, memory);
  GstBufferPool* chosen = nullptr;
  guint chosen_size = size, least = 0, most = 0;
  for (guint i = 0; i < gst_query_get_n_allocation_pools(query) && !chosen; i++) {
    guint their_size = 0;
    gst_query_parse_nth_allocation_pool(query, i, &chosen, &their_size, &least, &most);
    if (!chosen) continue;
    // Limits unlimited pools, which would otherwise keep the memory of a burst forever. Our own pool takes over beyond
    // the limit, but provides no GPU memory.
    most = !may_be_own ? 0 : most == 0 ? least + kMaxIdle : most;
    chosen_size = MAX(their_size, size);
    if (!configure(chosen, caps, chosen_size, least, most, memory)) gst_clear_object(&chosen);
  }
  gst_clear_object(&memory.allocator);
  if (!chosen) {
    if (has_own)
      chosen = GST_BUFFER_POOL(gst_object_ref(own_));
    else if (!may_be_own && gpu)
      chosen = gpu->pool(caps, size);
    if (!chosen) return false;
    chosen_size = size;
    least = most = 0;
  }
  if (gst_query_get_n_allocation_pools(query) > 0)
    gst_query_set_nth_allocation_pool(query, 0, chosen, chosen_size, least, most);
  else
    gst_query_add_allocation_pool(query, chosen, chosen_size, least, most);
  if (context && GST_IS_GL_BUFFER_POOL(chosen))
    *context = {GST_GL_CONTEXT(gst_object_ref(GST_GL_BUFFER_POOL(chosen)->context)), gst_object_unref};
  gst_object_unref(chosen);
  return true;
}

GstBuffer* PicturePool::take(GstBufferPool* chosen) {
  GstBufferPoolAcquireParams at_once = {};
  at_once.flags = GST_BUFFER_POOL_ACQUIRE_FLAG_DONTWAIT;
  GstBufferPool* const pools[] = {chosen, own_};
  for (GstBufferPool* pool : pools) {
    GstBuffer* buffer = nullptr;
    if (pool && gst_buffer_pool_set_active(pool, TRUE) &&
        gst_buffer_pool_acquire_buffer(pool, &buffer, &at_once) == GST_FLOW_OK)
      return buffer;
  }
  return nullptr;
}

void PicturePool::clear() {
  if (own_) gst_buffer_pool_set_active(own_, FALSE);
  gst_clear_object(&own_);
}

}  // namespace lf
