// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <deque>

#include <gst/gst.h>

#include "common/buffer_ptr.h"

namespace lf {

// What leaves behind a request, buffer by buffer: GstBaseSrc 1.22 has a buffer list mistaken for a buffer where a live
// source is stopped just after it was made. Streaming thread.
class RequestOutbox {
 public:
  // Takes a buffer (null: nothing), which gets the time stamps of the request.
  void put(GstBuffer* buffer, GstBuffer* request) {
    if (!buffer) return;
    gst_buffer_copy_into(buffer, request, GST_BUFFER_COPY_TIMESTAMPS, 0, -1);
    waiting_.emplace_back(buffer);
  }
  // The next one, owned by the caller; null: a request is to be made.
  GstBuffer* take() {
    if (waiting_.empty()) return nullptr;
    GstBuffer* buffer = waiting_.front().release();
    waiting_.pop_front();
    return buffer;
  }
  void clear() { waiting_.clear(); }

 private:
  std::deque<BufferPtr> waiting_;
};

}  // namespace lf
