// SPDX-License-Identifier: LGPL-2.1-or-later
#include "reception.h"

#define GST_USE_UNSTABLE_API
#include <gst/webrtc/webrtc.h>

namespace lf::serve {
namespace {

gboolean read_stats(GQuark, const GValue* value, gpointer data) {
  Reception& received = *static_cast<Reception*>(data);
  if (!GST_VALUE_HOLDS_STRUCTURE(value)) return TRUE;
  const GstStructure* s = gst_value_get_structure(value);
  GstWebRTCStatsType type;
  GstStructure* source = nullptr;
  if (!gst_structure_get(s, "type", GST_TYPE_WEBRTC_STATS_TYPE, &type, nullptr) ||
      type != GST_WEBRTC_STATS_REMOTE_INBOUND_RTP ||
      !gst_structure_get(s, "gst-rtpsource-stats", GST_TYPE_STRUCTURE, &source, nullptr))
    return TRUE;
  ReceptionReport report;
  if (gst_structure_get(source, "rb-ssrc", G_TYPE_UINT, &report.ssrc, "rb-exthighestseq", G_TYPE_UINT, &report.highest,
                        "rb-packetslost", G_TYPE_INT, &report.lost, nullptr))
    received.reports.push_back(report);
  gst_structure_free(source);
  gst_structure_get_double(s, "round-trip-time", &received.round_trip);
  return TRUE;
}

}  // namespace

Reception read_reception(const GstStructure* stats) {
  Reception received;
  gst_structure_foreach(stats, read_stats, &received);
  return received;
}

}  // namespace lf::serve
