// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstaggregator.h>

G_BEGIN_DECLS

#define LF_TYPE_COMPOSITOR (lf_compositor_get_type())
G_DECLARE_FINAL_TYPE(LfCompositor, lf_compositor, LF, COMPOSITOR, GstAggregator)

// Property "latency" at first, of GstAggregator: a frame period at 15/s. Only live pipelines wait for it.
#define LF_COMPOSITOR_LATENCY (60 * GST_MSECOND)

// Property "incomplete": what is put out for a request of which something is missing.
typedef enum {
  LF_COMPOSITOR_INCOMPLETE_CONCEAL,
  LF_COMPOSITOR_INCOMPLETE_REPEAT,
  LF_COMPOSITOR_INCOMPLETE_DROP,
} LfCompositorIncomplete;
#define LF_TYPE_COMPOSITOR_INCOMPLETE (lf_compositor_incomplete_get_type())
GType lf_compositor_incomplete_get_type(void);

// Property "focus": lf::FocusMode.
#define LF_TYPE_COMPOSITOR_FOCUS (lf_compositor_focus_get_type())
GType lf_compositor_focus_get_type(void);

// Property "show": lf::ShownWeights.
#define LF_TYPE_COMPOSITOR_SHOW (lf_compositor_show_get_type())
GType lf_compositor_show_get_type(void);

// Property "gains": whether cameras match their brightness. A truth value sets it, too.
typedef enum {
  LF_COMPOSITOR_GAINS_OFF = 0,
  LF_COMPOSITOR_GAINS_ON = 1,
  LF_COMPOSITOR_GAINS_AUTO,
} LfCompositorGains;
#define LF_TYPE_COMPOSITOR_GAINS (lf_compositor_gains_get_type())
GType lf_compositor_gains_get_type(void);

GST_ELEMENT_REGISTER_DECLARE(lfcompositor);

G_END_DECLS
