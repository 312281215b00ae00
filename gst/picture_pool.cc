// SPDX-License-Identifier: LGPL-2.1-or-later
#include "picture_pool.h"

#include <gst/video/video.h>

namespace lf {

bool PicturePool::configure(GstCaps* caps, gsize size) {
  clear();
  pool_ = gst_video_buffer_pool_new();
  GstStructure* config = gst_buffer_pool_get_config(pool_);
  gst_buffer_pool_config_set_params(config, caps, static_cast<guint>(size), 2, 0);
  return gst_buffer_pool_set_config(pool_, config) && gst_buffer_pool_set_active(pool_, TRUE);
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
