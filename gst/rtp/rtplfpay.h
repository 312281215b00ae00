// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>
#include <gst/rtp/gstrtpbasepayload.h>

G_BEGIN_DECLS

#define LF_TYPE_RTP_PAY (lf_rtp_pay_get_type())
G_DECLARE_FINAL_TYPE(LfRtpPay, lf_rtp_pay, LF, RTP_PAY, GstRTPBasePayload)

GST_ELEMENT_REGISTER_DECLARE(rtplfpay)

G_END_DECLS
