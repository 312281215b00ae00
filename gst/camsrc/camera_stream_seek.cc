// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Seeks of a camera that is read from files: so that capture times stay those of the film, whatever the source is.
#include <algorithm>
#include <filesystem>
#include <string>
#include <utility>

#include "camsrc/camera_stream.h"

namespace lf {
namespace {

struct Rate {
  gint n = 0, d = 1;
  GstClockTime time(guint64 frame) const {
    return gst_util_uint64_scale(frame, GST_SECOND * static_cast<guint64>(d), static_cast<guint64>(n));
  }
};

Rate rate_of(GstElement* multifilesrc) {
  Rate rate;
  GstCaps* caps = nullptr;
  g_object_get(multifilesrc, "caps", &caps, nullptr);
  gst_structure_get_fraction(gst_caps_get_structure(caps, 0), "framerate", &rate.n, &rate.d);
  gst_caps_unref(caps);
  return rate;
}

bool has_file(const std::string& pattern, guint64 index) {
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
  g_autofree gchar* path = g_strdup_printf(pattern.c_str(), static_cast<gint>(index));  // one %d, see camera_source.cc
#pragma GCC diagnostic pop
  std::error_code error;
  return std::filesystem::exists(path, error);
}

// How many files there are, numbered without a gap; at least 1.
guint64 count_files(const std::string& pattern, guint64 first) {
  guint64 least = 1, beyond = 2;
  while (has_file(pattern, first + beyond - 1)) least = std::exchange(beyond, beyond * 2);
  while (beyond - least > 1) {
    const guint64 middle = (least + beyond) / 2;
    (has_file(pattern, first + middle - 1) ? least : beyond) = middle;
  }
  return least;
}

}  // namespace

GstPadProbeReturn CameraStream::on_seek(GstPadProbeInfo* info) {
  GstEvent* event = GST_PAD_PROBE_INFO_EVENT(info);
  gdouble rate = 0;
  GstFormat format = GST_FORMAT_UNDEFINED;
  GstSeekFlags flags{};
  GstSeekType start_type{}, stop_type{};
  gint64 start = 0, stop = 0;
  gst_event_parse_seek(event, &rate, &format, &flags, &start_type, &start, &stop_type, &stop);
  if (live_ || rate <= 0 || format != GST_FORMAT_TIME || start_type != GST_SEEK_TYPE_SET || start < 0)
    return GST_PAD_PROBE_OK;
  const guint32 seqnum = gst_event_get_seqnum(event);
  const std::lock_guard lock(seeking_);
  if (failed_ || stopping_) return GST_PAD_PROBE_DROP;  // nothing comes any more
  sought_ = true;
  if (chain_.sequence) {
    seek_sequence(static_cast<guint64>(start), flags, seqnum);
    return GST_PAD_PROBE_DROP;
  }
  if (!options_.seek_to_loop) return GST_PAD_PROBE_OK;
  // What is in a later round of a film that loops is come to from the beginning.
  gint64 duration = 0;
  if (gst_pad_peer_query_duration(chain_.decoded, GST_FORMAT_TIME, &duration) && start >= duration) start = 0;
  GstEvent* there = gst_event_new_seek(rate, format, flags, start_type, start, stop_type, stop);
  gst_event_set_seqnum(there, seqnum);
  // Here, because it and the one back to the beginning have to follow each other, and that is not done once it is.
  return gst_pad_push_event(chain_.decoded, there) ? GST_PAD_PROBE_DROP : GST_PAD_PROBE_OK;
}

// multifilesrc knows bytes alone, but counts files by time where it is sought. What it gives then has times from 0 on.
void CameraStream::seek_sequence(guint64 time, GstSeekFlags flags, guint32 seqnum) {
  g_autofree gchar* pattern = nullptr;
  gint first = 0;
  gboolean loop = FALSE;
  g_object_get(chain_.sequence, "location", &pattern, "start-index", &first, "loop", &loop, nullptr);
  const Rate rate = rate_of(chain_.sequence);
  if (rate.n <= 0) return;
  const guint64 count = count_files(pattern, static_cast<guint64>(first));
  guint64 frame = gst_util_uint64_scale(time, static_cast<guint64>(rate.n), GST_SECOND * static_cast<guint64>(rate.d));
  if (!loop) frame = std::min(frame, count - 1);
  sequence_starts_at_ = rate.time(frame);
  const guint64 file = static_cast<guint64>(first) + frame % count;
  GstEvent* seek = gst_event_new_seek(1, GST_FORMAT_BYTES, flags, GST_SEEK_TYPE_SET,
                                      static_cast<gint64>(rate.time(file) + 1), GST_SEEK_TYPE_NONE, -1);
  gst_event_set_seqnum(seek, seqnum);
  GstPad* src = gst_element_get_static_pad(chain_.sequence, "src");
  gst_pad_send_event(src, seek);
  gst_object_unref(src);
}

GstPadProbeReturn CameraStream::on_sequence(GstPad* /*pad*/, GstPadProbeInfo* info) {
  GstEvent* event = GST_PAD_PROBE_INFO_EVENT(info);
  if (GST_EVENT_TYPE(event) != GST_EVENT_SEGMENT) return GST_PAD_PROBE_OK;
  capture_offset_ = sequence_starts_at_;
  pictures_ = 0;
  GstSegment from_zero;
  gst_segment_init(&from_zero, GST_FORMAT_BYTES);
  GstEvent* segment = gst_event_new_segment(&from_zero);
  gst_event_set_seqnum(segment, gst_event_get_seqnum(event));
  gst_event_unref(event);
  info->data = segment;
  return GST_PAD_PROBE_OK;
}

}  // namespace lf
