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

// Caps that several owners may share; null: none. share_caps() takes over one reference.
using SharedCaps = std::shared_ptr<GstCaps>;
inline SharedCaps share_caps(GstCaps* caps) {
  return caps ? SharedCaps(caps, [](GstCaps* owned) { gst_caps_unref(owned); }) : nullptr;
}

}  // namespace lf
