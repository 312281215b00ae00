// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/in_process.h"

#include <gst/gl/gl.h>

namespace lf {

static constexpr char kContext[] = "context";

bool is_in_process_query(GstQuery* query) {
  const GstStructure* structure = GST_QUERY_TYPE(query) == GST_QUERY_CUSTOM ? gst_query_get_structure(query) : nullptr;
  return structure && gst_structure_has_name(structure, LF_IN_PROCESS_QUERY);
}

void answer_in_process_query(GstQuery* query, GstGLContext* context) {
  if (context) gst_structure_set(gst_query_writable_structure(query), kContext, GST_TYPE_GL_CONTEXT, context, nullptr);
}

NearCompositor near_compositor(GstPad* src) {
  GstQuery* query = gst_query_new_custom(GST_QUERY_CUSTOM, gst_structure_new_empty(LF_IN_PROCESS_QUERY));
  NearCompositor compositor{.is_there = static_cast<bool>(gst_pad_peer_query(src, query)), .context = {}};
  GstGLContext* context = nullptr;
  if (gst_structure_get(gst_query_get_structure(query), kContext, GST_TYPE_GL_CONTEXT, &context, nullptr) && context) {
    compositor.group = share_group(context);
    compositor.context = WeakGlContext(context);
    gst_object_unref(context);
  }
  gst_query_unref(query);
  return compositor;
}

}  // namespace lf
