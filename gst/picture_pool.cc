// SPDX-License-Identifier: LGPL-2.1-or-later
#include "picture_pool.h"

#include <gst/video/gstvideopool.h>

namespace {

// A pool of videos that shrinks again: what comes back beyond a few that lie idle is freed.
struct LfShrinkingPool {
  GstVideoBufferPool parent;
  gint buffers, in_use;
};
struct LfShrinkingPoolClass {
  GstVideoBufferPoolClass parent_class;
};

G_DEFINE_TYPE(LfShrinkingPool, lf_shrinking_pool, GST_TYPE_VIDEO_BUFFER_POOL)

LfShrinkingPool* shrinking_pool(GstBufferPool* pool) { return reinterpret_cast<LfShrinkingPool*>(pool); }

GstBufferPoolClass* base_class() { return GST_BUFFER_POOL_CLASS(lf_shrinking_pool_parent_class); }

GstFlowReturn alloc(GstBufferPool* pool, GstBuffer** buffer, GstBufferPoolAcquireParams* params) {
  const GstFlowReturn flow = base_class()->alloc_buffer(pool, buffer, params);
  if (flow == GST_FLOW_OK) g_atomic_int_inc(&shrinking_pool(pool)->buffers);
  return flow;
}

void free_buffer(GstBufferPool* pool, GstBuffer* buffer) {
  g_atomic_int_add(&shrinking_pool(pool)->buffers, -1);
  base_class()->free_buffer(pool, buffer);
}

GstFlowReturn acquire(GstBufferPool* pool, GstBuffer** buffer, GstBufferPoolAcquireParams* params) {
  const GstFlowReturn flow = base_class()->acquire_buffer(pool, buffer, params);
  if (flow == GST_FLOW_OK) g_atomic_int_inc(&shrinking_pool(pool)->in_use);
  return flow;
}

void release(GstBufferPool* pool, GstBuffer* buffer) {
  LfShrinkingPool* self = shrinking_pool(pool);
  const gint in_use = g_atomic_int_add(&self->in_use, -1) - 1;
  if (g_atomic_int_get(&self->buffers) - in_use > lf::PicturePool::kMostIdle)
    GST_BUFFER_FLAG_SET(buffer, GST_BUFFER_FLAG_TAG_MEMORY);  // the base class frees it then
  base_class()->release_buffer(pool, buffer);
}

void lf_shrinking_pool_class_init(LfShrinkingPoolClass* klass) {
  GstBufferPoolClass* pool_class = GST_BUFFER_POOL_CLASS(klass);
  pool_class->alloc_buffer = alloc;
  pool_class->free_buffer = free_buffer;
  pool_class->acquire_buffer = acquire;
  pool_class->release_buffer = release;
}

void lf_shrinking_pool_init(LfShrinkingPool*) {}

// Takes the pool. Null if it can't be used.
GstBufferPool* start(GstBufferPool* pool, GstCaps* caps, guint size, guint least) {
  GstStructure* config = gst_buffer_pool_get_config(pool);
  gst_buffer_pool_config_set_params(config, caps, size, least, 0);
  if (gst_buffer_pool_has_option(pool, GST_BUFFER_POOL_OPTION_VIDEO_META))
    gst_buffer_pool_config_add_option(config, GST_BUFFER_POOL_OPTION_VIDEO_META);
  if (gst_buffer_pool_set_config(pool, config) && gst_buffer_pool_set_active(pool, TRUE)) return pool;
  gst_object_unref(pool);
  return nullptr;
}

// Downstream's pool of memory of its own. None with a limit: pictures are kept here to be shown again, and nobody may
// wait for those. Plain memory is no reason for a pool that never shrinks.
GstBufferPool* offered_pool(GstPad* src, GstCaps* caps, gsize size) {
  GstQuery* query = gst_query_new_allocation(caps, TRUE);
  GstBufferPool* pool = nullptr;
  guint their_size = 0, least = 0, most = 0;
  if (gst_pad_peer_query(src, query) && gst_query_get_n_allocation_pools(query) > 0)
    gst_query_parse_nth_allocation_pool(query, 0, &pool, &their_size, &least, &most);
  gst_query_unref(query);
  const bool plain =
      pool && (G_OBJECT_TYPE(pool) == GST_TYPE_VIDEO_BUFFER_POOL || G_OBJECT_TYPE(pool) == GST_TYPE_BUFFER_POOL);
  if (pool && (plain || most > 0 || gst_buffer_pool_is_active(pool))) gst_clear_object(&pool);
  return pool ? start(pool, caps, MAX(their_size, static_cast<guint>(size)), least) : nullptr;
}

}  // namespace

namespace lf {

bool PicturePool::configure(GstPad* src, GstCaps* caps, gsize size) {
  clear();
  pool_ = offered_pool(src, caps, size);
  if (!pool_) {
    auto* own = GST_BUFFER_POOL(g_object_new(lf_shrinking_pool_get_type(), nullptr));
    pool_ = start(GST_BUFFER_POOL(gst_object_ref_sink(own)), caps, static_cast<guint>(size), 0);
  }
  return pool_ != nullptr;
}

GstBuffer* PicturePool::take() {
  GstBuffer* buffer = nullptr;
  if (gst_buffer_pool_acquire_buffer(pool_, &buffer, nullptr) != GST_FLOW_OK) return nullptr;
  return buffer;
}

void PicturePool::clear() {
  if (pool_) gst_buffer_pool_set_active(pool_, FALSE);
  gst_clear_object(&pool_);
}

}  // namespace lf
