// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include "common/gl_share.h"

// Custom query with which a node asks downstream whether the compositor is in its process: lfcompositor answers TRUE.
// Elements that keep buffers as they are (queue, tee, identity, funnel) pass it on; files, sockets and payloaders don't
// know it. "context" (GstGLContext) is in it where the compositor's pictures are in a graphics card's memory: sums that
// the node renders in a context which shares with that one need not leave the card.
#define LF_IN_PROCESS_QUERY "lightfield-in-process"

namespace lf {

bool is_in_process_query(GstQuery* query);
// Answers it. `context`: null if pictures are not in a card's memory.
void answer_in_process_query(GstQuery* query, GstGLContext* context);

// The compositor that answers pushed on this pad come to in this process.
struct NearCompositor {
  bool is_there = false;
  // The contexts of its pictures; 0: they are not in a card's memory. One of them, as long as it is there.
  gl::ShareGroup group = 0;
  WeakGlContext context;
};
NearCompositor near_compositor(GstPad* src);

}  // namespace lf
