// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/sender_clock.h"

#include "common/guard.h"

namespace lf {
namespace {

constexpr const char* kAddMeta = "add-reference-timestamp-meta";
constexpr GstClockTime k1970 = 2'208'988'800 * GST_SECOND;  // in NTP's time, which begins with 1900

GstClockTime time_of_day() { return static_cast<GstClockTime>(g_get_real_time()) * GST_USECOND; }

bool is_video(GstPad* pad) {
  GstCaps* caps = gst_pad_get_current_caps(pad);
  if (!caps) caps = gst_pad_query_caps(pad, nullptr);
  const GstStructure* structure = gst_caps_get_size(caps) > 0 ? gst_caps_get_structure(caps, 0) : nullptr;
  const gchar* media = structure ? gst_structure_get_string(structure, "media") : nullptr;
  const bool video = !media || g_str_equal(media, "video");
  gst_caps_unref(caps);
  return video;
}

// Sent when, in NTP's time; nothing where no report has come yet.
std::optional<GstClockTime> ntp_time(GstBuffer* packet) {
  static GstStaticCaps ntp = GST_STATIC_CAPS("timestamp/x-ntp");
  GstCaps* reference = gst_static_caps_get(&ntp);
  const GstReferenceTimestampMeta* meta = gst_buffer_get_reference_timestamp_meta(packet, reference);
  gst_caps_unref(reference);
  if (!meta || meta->timestamp < k1970) return std::nullopt;
  return meta->timestamp;
}

GstClockTime running_time(GstPad* pad, GstClockTime pts) {
  GstEvent* event = gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0);
  if (!event) return GST_CLOCK_TIME_NONE;
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event, &segment);
  const GstClockTime time = gst_segment_to_running_time(segment, GST_FORMAT_TIME, pts);
  gst_event_unref(event);
  return time;
}

void forget(gpointer self, GClosure*) { delete static_cast<std::shared_ptr<SenderClock>*>(self); }

}  // namespace

void SenderClock::see(GstClockTime stamp, GstClockTime sent, GstClockTime now) {
  const GstClockTimeDiff age = GST_CLOCK_DIFF(sent, now);
  const bool true_enough =
      age >= -static_cast<GstClockTimeDiff>(kMostAhead) && age <= static_cast<GstClockTimeDiff>(latency_ + kMostAge);
  const std::lock_guard lock(mutex_);
  offset_.reset();
  if (true_enough) offset_ = GST_CLOCK_DIFF(stamp, sent);
}

std::optional<GstClockTime> SenderClock::taken(GstClockTime stamp) const {
  const std::lock_guard lock(mutex_);
  if (!offset_) return std::nullopt;
  return stamp + static_cast<GstClockTime>(*offset_);
}

bool SenderClock::is_known() const {
  const std::lock_guard lock(mutex_);
  return offset_.has_value();
}

GstPadProbeReturn SenderClock::on_packet(GstPad* pad, GstPadProbeInfo* info, gpointer data) {
  GstBuffer* packet = nullptr;
  if (!(info->type & GST_PAD_PROBE_TYPE_BUFFER_LIST))
    packet = GST_PAD_PROBE_INFO_BUFFER(info);
  else if (GstBufferList* list = GST_PAD_PROBE_INFO_BUFFER_LIST(info); gst_buffer_list_length(list) > 0)
    packet = gst_buffer_list_get(list, 0);
  const std::optional<GstClockTime> ntp = packet ? ntp_time(packet) : std::nullopt;
  if (!ntp) return GST_PAD_PROBE_OK;
  const GstClockTime stamp = running_time(pad, GST_BUFFER_PTS(packet));
  if (GST_CLOCK_TIME_IS_VALID(stamp))
    (*static_cast<std::shared_ptr<SenderClock>*>(data))->see(stamp, *ntp - k1970, time_of_day());
  return GST_PAD_PROBE_OK;
}

void SenderClock::on_pad(GstElement*, GstPad* pad, gpointer data) {
  if (!GST_PAD_IS_SRC(pad) || !is_video(pad)) return;
  gst_pad_add_probe(pad, GstPadProbeType(GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_BUFFER_LIST),
                    callback<on_packet>, new std::shared_ptr(*static_cast<std::shared_ptr<SenderClock>*>(data)),
                    [](gpointer self) { forget(self, nullptr); });
}

void SenderClock::watch(GstElement* source) {
  if (!g_object_class_find_property(G_OBJECT_GET_CLASS(source), kAddMeta)) return;
  g_object_set(source, kAddMeta, TRUE, nullptr);
  g_signal_connect_data(source, "pad-added", G_CALLBACK(callback<on_pad>), new std::shared_ptr(shared_from_this()),
                        forget, GConnectFlags(0));
}

}  // namespace lf
