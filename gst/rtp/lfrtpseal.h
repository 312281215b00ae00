// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS

#define LF_TYPE_RTP_SEAL (lf_rtp_seal_get_type())
G_DECLARE_FINAL_TYPE(LfRtpSeal, lf_rtp_seal, LF, RTP_SEAL, GstElement)
GST_ELEMENT_REGISTER_DECLARE(lfrtpseal)

G_END_DECLS
