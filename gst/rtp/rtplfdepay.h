// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>
#include <gst/rtp/gstrtpbasedepayload.h>

G_BEGIN_DECLS

#define LF_TYPE_RTP_DEPAY (lf_rtp_depay_get_type())
G_DECLARE_FINAL_TYPE(LfRtpDepay, lf_rtp_depay, LF, RTP_DEPAY, GstRTPBaseDepayload)

GST_ELEMENT_REGISTER_DECLARE(rtplfdepay)

G_END_DECLS
