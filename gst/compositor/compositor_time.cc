// SPDX-License-Identifier: LGPL-2.1-or-later
#include "compositor/lfcompositor_private.h"

bool lf_compositor_is_live(LfCompositor* self) {
  return GST_CLOCK_TIME_IS_VALID(gst_aggregator_get_latency(GST_AGGREGATOR(self)));
}

GstClockTime lf_compositor_clock_time(LfCompositor* self) {
  GstClock* clock = gst_element_get_clock(GST_ELEMENT(self));
  if (!clock) return GST_CLOCK_TIME_NONE;
  const GstClockTime now = gst_clock_get_time(clock);
  gst_object_unref(clock);
  return now;
}

GstClockTime lf_compositor_running_time(LfCompositor* self, GstBuffer* request) {
  return gst_segment_to_running_time(&GST_AGGREGATOR_PAD(self->request)->segment, GST_FORMAT_TIME,
                                     GST_BUFFER_PTS(request));
}

// When the picture of the request at the head of its pad has to be out, in clock time.
GstClockTime lf_compositor_deadline(LfCompositor* self) {
  GstBuffer* request = gst_aggregator_pad_peek_buffer(GST_AGGREGATOR_PAD(self->request));
  if (!request) return GST_CLOCK_TIME_NONE;
  const GstClockTime time = lf_compositor_running_time(self, request);
  gst_buffer_unref(request);
  const GstClockTime latency = gst_aggregator_get_latency(GST_AGGREGATOR(self));
  if (!GST_CLOCK_TIME_IS_VALID(time) || !GST_CLOCK_TIME_IS_VALID(latency)) return GST_CLOCK_TIME_NONE;
  return gst_element_get_base_time(GST_ELEMENT(self)) + time + latency;
}

// A request that comes later than the latency says: that has grown, and perhaps nobody heeds the message about it. What
// is too short would have pictures made before their answers can be there.
void lf_compositor_refresh_latency(LfCompositor* self) {
  auto& state = *self->state;
  const GstClockTime latency = gst_aggregator_get_latency(GST_AGGREGATOR(self)), now = lf_compositor_clock_time(self);
  GstBuffer* request = gst_aggregator_pad_peek_buffer(GST_AGGREGATOR_PAD(self->request));
  if (!request) return;
  const GstClockTime time = lf_compositor_running_time(self, request);
  gst_buffer_unref(request);
  if (!GST_CLOCK_TIME_IS_VALID(latency) || !GST_CLOCK_TIME_IS_VALID(now) || !GST_CLOCK_TIME_IS_VALID(time)) return;
  GstClockTime own = 0;
  g_object_get(self, "latency", &own, nullptr);
  const GstClockTime expected = gst_element_get_base_time(GST_ELEMENT(self)) + time + latency - MIN(own, latency);
  const int64_t asked = g_get_monotonic_time();
  if (now <= expected + 2 * GST_MSECOND) return;
  if (state.latency_asked_at != 0 && asked < state.latency_asked_at + G_USEC_PER_SEC / 10) return;
  state.latency_asked_at = asked;
  GstQuery* query = gst_query_new_latency();
  gst_pad_query(GST_AGGREGATOR_SRC_PAD(self), query);  // the base class keeps what comes of it
  gst_query_unref(query);
}
