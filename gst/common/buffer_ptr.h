// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include <gst/gst.h>

namespace lf {

struct UnrefBuffer {
  void operator()(GstBuffer* buffer) const { gst_buffer_unref(buffer); }
};
// Owns one reference of a buffer.
using BufferPtr = std::unique_ptr<GstBuffer, UnrefBuffer>;

}  // namespace lf
