// SPDX-License-Identifier: LGPL-2.1-or-later
//
// What is to be kept of a camera: its pictures as it has coded them, seen before they are decoded, or its frames.
#include <algorithm>

#include "camsrc/camera_stream.h"
#include "camsrc/chain_links.h"
#include "common/coded_video.h"
#include "image/picture_bytes.h"

namespace lf {

// Where in the film, or when by running time, a picture was taken that has a stamp in `segment`; it may be one from
// before the segment, which those in it need.
std::optional<GstClockTime> CameraStream::taken_at(GstSegment segment, GstClockTime stamp) const {
  if (segment.format != GST_FORMAT_TIME || !GST_CLOCK_TIME_IS_VALID(stamp)) return std::nullopt;
  if (round_start_ > 0) segment.base = round_start_;  // as later_segment() makes it, behind the decoder
  guint64 time = 0;
  const int sign = live_ ? gst_segment_to_running_time_full(&segment, GST_FORMAT_TIME, stamp, &time)
                         : gst_segment_to_stream_time_full(&segment, GST_FORMAT_TIME, stamp, &time);
  if (sign == 0) return std::nullopt;
  const gint64 taken = (sign < 0 ? -1 : 1) * static_cast<gint64>(time) + (live_ ? 0 : static_cast<gint64>(film_start_));
  return static_cast<GstClockTime>(std::max<gint64>(taken, 0));
}

// Until a frame is sent nobody knows the time that a live picture was taken at, nor whether a film has caught up.
GstPadProbeReturn CameraStream::on_coded(GstPad* pad, GstPadProbeInfo* info) {
  GstBuffer* picture = GST_PAD_PROBE_INFO_BUFFER(info);
  g_autoptr(GstCaps) caps = gst_pad_get_current_caps(pad);
  if (!caps || !find_coded_video(caps) || is_turned(pad)) return GST_PAD_PROBE_OK;
  const std::lock_guard lock(keeping_);
  if (!coded_pad_) coded_pad_ = GST_PAD(gst_object_ref(pad));
  g_autoptr(GstEvent) event = pad == coded_pad_ ? gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0) : nullptr;
  if (!event) return GST_PAD_PROBE_OK;
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event, &segment);
  const std::optional<GstClockTime> taken = taken_at(*segment, GST_BUFFER_PTS(picture));
  if (frames_out_ == 0 && options_.catches_up)
    coded_.begin_again();
  else if (!taken)
    return GST_PAD_PROBE_OK;
  else if (frames_out_ == 0)
    coded_.wait(picture, *taken);
  else if (coded_.admits(picture))
    listener_.on_keepsake(picture, caps, coded_.in_order(*taken, capture_time(*taken)));
  return GST_PAD_PROBE_OK;
}

// jpegdec shows grey where a picture was cut off, and says nothing. Cameras that never write the end marker exist.
GstPadProbeReturn CameraStream::on_jpeg(GstPad*, GstPadProbeInfo* info) {
  const MappedBuffer bytes(GST_PAD_PROBE_INFO_BUFFER(info));
  const bool is_whole = jpeg_end(bytes.bytes()).has_value();
  jpegs_have_ends_ = jpegs_have_ends_ || is_whole;
  if (is_whole || !jpegs_have_ends_) return GST_PAD_PROBE_OK;
  ++*chain_.damaged;
  return GST_PAD_PROBE_DROP;
}

// A file may say how long a coded picture lasts; parsers put a period of theirs in its place.
GstPadProbeReturn CameraStream::on_parsed(GstPad* pad, GstPadProbeInfo* info) {
  const GstBuffer* picture = GST_PAD_PROBE_INFO_BUFFER(info);
  g_autoptr(GstCaps) caps = gst_pad_get_current_caps(pad);
  g_autoptr(GstEvent) event = gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0);
  if (!event || !caps || !find_coded_video(caps) || !GST_BUFFER_PTS_IS_VALID(picture)) return GST_PAD_PROBE_OK;
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event, &segment);
  guint64 begin = 0;
  if (segment->format != GST_FORMAT_TIME ||
      gst_segment_to_stream_time_full(segment, GST_FORMAT_TIME, GST_BUFFER_PTS(picture), &begin) != 1)
    return GST_PAD_PROBE_OK;
  if (const GstClockTime last = told_begin_; GST_CLOCK_TIME_IS_VALID(last) && begin < last) return GST_PAD_PROBE_OK;
  told_begin_ = begin;
  told_end_ = GST_BUFFER_DURATION_IS_VALID(picture) ? begin + GST_BUFFER_DURATION(picture) : GST_CLOCK_TIME_NONE;
  return GST_PAD_PROBE_OK;
}

// What has waited for the first frame to be sent.
void CameraStream::keep_waiting() {
  const std::lock_guard lock(keeping_);
  if (!coded_pad_) return;
  g_autoptr(GstCaps) caps = gst_pad_get_current_caps(coded_pad_);
  for (const CodedPictures::Picture& picture : coded_.take_waiting())
    if (caps)
      listener_.on_keepsake(picture.buffer.get(), caps, coded_.in_order(picture.taken, capture_time(picture.taken)));
}

}  // namespace lf
