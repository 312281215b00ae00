// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS

#define LF_TYPE_RTP_GATE (lf_rtp_gate_get_type())
G_DECLARE_FINAL_TYPE(LfRtpGate, lf_rtp_gate, LF, RTP_GATE, GstElement)
GST_ELEMENT_REGISTER_DECLARE(lfrtpgate)

G_END_DECLS
