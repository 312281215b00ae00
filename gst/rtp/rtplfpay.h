// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>
#include <gst/rtp/gstrtpbasepayload.h>

#include "common/common.h"
#include "wire/unit.h"

#define LF_RTP_REQUEST_ENCODING "X-LIGHTFIELD-REQUEST"
#define LF_RTP_ANSWER_ENCODING "X-LIGHTFIELD-ANSWER"
#define LF_RTP_CAPS                                                             \
  "application/x-rtp, media = (string) application, clock-rate = (int) 90000, " \
  "encoding-name = (string) { " LF_RTP_REQUEST_ENCODING ", " LF_RTP_ANSWER_ENCODING " }"

namespace lf {

inline wire::UnitKind kind_of_rtp(const GstStructure* caps) {
  const gchar* name = gst_structure_get_string(caps, "encoding-name");
  return g_strcmp0(name, LF_RTP_REQUEST_ENCODING) == 0 ? wire::UnitKind::kRequest : wire::UnitKind::kAnswer;
}
inline wire::UnitKind kind_of_units(const GstStructure* caps) {
  return gst_structure_has_name(caps, LF_REQUEST_MEDIA_TYPE) ? wire::UnitKind::kRequest : wire::UnitKind::kAnswer;
}

// Returns the property `stats` of the base class of a payloader or depayloader, to extend the structure. Other elements
// (rtspsrc, rtpbin) read its fields, so they must stay. The caller owns the structure.
inline GstStructure* base_stats(GObject* object, gpointer parent_class) {
  GObjectClass* base = G_OBJECT_CLASS(parent_class);
  GParamSpec* spec = g_object_class_find_property(base, "stats");
  GValue value = G_VALUE_INIT;
  g_value_init(&value, GST_TYPE_STRUCTURE);
  base->get_property(object, spec->param_id, &value, spec);
  GstStructure* stats = static_cast<GstStructure*>(g_value_dup_boxed(&value));
  g_value_unset(&value);
  return stats;
}

}  // namespace lf

#define LF_TYPE_RTP_PAY (lf_rtp_pay_get_type())
G_DECLARE_FINAL_TYPE(LfRtpPay, lf_rtp_pay, LF, RTP_PAY, GstRTPBasePayload)
