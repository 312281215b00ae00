// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstaggregator.h>

G_BEGIN_DECLS

#define LF_TYPE_COMPOSITOR (lf_compositor_get_type())
G_DECLARE_FINAL_TYPE(LfCompositor, lf_compositor, LF, COMPOSITOR, GstAggregator)

GST_ELEMENT_REGISTER_DECLARE(lfcompositor);

G_END_DECLS
