// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS

#define LF_TYPE_NODE_SINK (lf_node_sink_get_type())
G_DECLARE_FINAL_TYPE(LfNodeSink, lf_node_sink, LF, NODE_SINK, GstBin)
GST_ELEMENT_REGISTER_DECLARE(lfnodesink)

G_END_DECLS
