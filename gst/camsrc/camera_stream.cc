// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/camera_stream.h"

#include <algorithm>
#include <optional>
#include <string>
#include <utility>

#include <gst/video/gstvideodecoder.h>
#include <gst/video/video.h>

#include "base/schedule.h"
#include "base/text.h"
#include "camsrc/camera_chain.h"
#include "common/coded_video.h"
#include "common/common.h"
#include "common/gst_wire.h"
#include "image/image_file.h"
#include "jpeg/header.h"

namespace lf {

bool CodedPictures::admits(GstBuffer* picture) {
  has_key_ = has_key_ || !GST_BUFFER_FLAG_IS_SET(picture, GST_BUFFER_FLAG_DELTA_UNIT);
  return has_key_;
}

void CodedPictures::begin_again() {
  has_key_ = false;
  waiting_.clear();
}

void CodedPictures::wait(GstBuffer* picture, GstClockTime taken) {
  if (waiting_.size() >= kMostWaiting) begin_again();
  if (admits(picture)) waiting_.push_back({BufferPtr(gst_buffer_ref(picture)), taken});
}

std::vector<CodedPictures::Picture> CodedPictures::take_waiting() { return std::exchange(waiting_, {}); }

GstClockTime CodedPictures::in_order(GstClockTime taken, GstClockTime captured) {
  constexpr GstClockTime kLeast = 10 * GST_USECOND;  // times in a file are multiples of it
  const bool is_newest = taken > newest_taken_;
  if (!is_newest) return captured;
  if (newest_captured_ > 0 && captured <= newest_captured_ && newest_captured_ - captured < kMostBack)
    captured = newest_captured_ + kLeast;
  newest_taken_ = taken;
  newest_captured_ = captured;
  return captured;
}

namespace {

GstCaps* capture_time_reference() {
  static GstStaticCaps caps = GST_STATIC_CAPS(LF_CAPTURE_TIME_CAPS);
  return gst_static_caps_get(&caps);
}

// The buffer goes no further, and upstream is told why.
GstPadProbeReturn refuse(GstPadProbeInfo* info, GstFlowReturn reason) {
  gst_clear_buffer(reinterpret_cast<GstBuffer**>(&info->data));
  GST_PAD_PROBE_INFO_FLOW_RETURN(info) = reason;
  return GST_PAD_PROBE_HANDLED;
}

// For an end of a segment that nobody asked for. Takes and gives a reference.
GstEvent* as_end(GstEvent* event) {
  GstEvent* end = gst_event_new_eos();
  gst_event_set_seqnum(end, gst_event_get_seqnum(event));
  gst_event_unref(event);
  return end;
}

// Calls `method` of the CameraStream that `data` points at weakly: an event from downstream may be on its way through a
// pad of a chain that is taken apart.
template <auto method>
GstPadProbeReturn call(GstPad* pad, GstPadProbeInfo* info, gpointer data) {
  const auto stream = static_cast<std::weak_ptr<CameraStream>*>(data)->lock();
  if (!stream) return GST_PAD_PROBE_OK;
  return guarded(pad, GST_PAD_PROBE_DROP, [&] { return ((*stream).*method)(pad, info); });
}

// `callback`: one of call<>.
void add_probe(GstPad* pad, int type, GstPadProbeCallback callback, const std::weak_ptr<CameraStream>& stream) {
  gst_pad_add_probe(pad, GstPadProbeType(type), callback, new std::weak_ptr(stream),
                    [](gpointer data) { delete static_cast<std::weak_ptr<CameraStream>*>(data); });
}

}  // namespace

CameraStream::CameraStream(GstElement* owner, const CameraChain& chain, const StreamOptions& options,
                           const StreamListener& listener)
    : owner_(owner),
      chain_(chain),
      options_(options),
      listener_(listener),
      stream_end_(options.begin),
      round_start_(options.begin),
      round_(options.round),
      film_end_(options.begin),
      film_start_(options.begin),
      dropped_before_(options.shedder ? options.shedder->dropped() : 0) {
  gst_segment_init(&segment_, GST_FORMAT_TIME);
  for (GstPad* pad : {chain_.decoded, chain_.frames, chain_.out}) gst_object_ref(pad);
}

CameraStream::~CameraStream() {
  for (GstPad* pad : {chain_.decoded, chain_.frames, chain_.out}) gst_object_unref(pad);
  gst_clear_object(&coded_pad_);
}

void CameraStream::watch_element(GstElement* element) {
  GstElementFactory* factory = gst_element_get_factory(element);
  if (factory && g_str_equal(GST_OBJECT_NAME(factory), "jpegdec")) {
    g_autoptr(GstPad) sink = gst_element_get_static_pad(element, "sink");
    add_probe(sink, GST_PAD_PROBE_TYPE_BUFFER, call<&CameraStream::on_jpeg>, weak_from_this());
  }
  const bool is_parser =
      options_.seek_to_loop && factory && gst_element_factory_list_is_type(factory, GST_ELEMENT_FACTORY_TYPE_PARSER);
  if (!is_parser && (!listener_.on_keepsake || !GST_IS_VIDEO_DECODER(element))) return;
  GstPad* sink = gst_element_get_static_pad(element, "sink");
  if (!sink) return;
  add_probe(sink, GST_PAD_PROBE_TYPE_BUFFER, is_parser ? call<&CameraStream::on_parsed> : call<&CameraStream::on_coded>,
            weak_from_this());
  gst_object_unref(sink);
}

void CameraStream::watch() {
  constexpr auto kData = GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM;
  const auto probe = [this](GstPad* pad, int type, GstPadProbeCallback callback) {
    add_probe(pad, type, callback, weak_from_this());
  };
  probe(chain_.decoded, kData | GST_PAD_PROBE_TYPE_EVENT_FLUSH, call<&CameraStream::on_decoded>);
  probe(chain_.frames, kData, call<&CameraStream::on_frame>);
  probe(chain_.out, kData | GST_PAD_PROBE_TYPE_EVENT_UPSTREAM, call<&CameraStream::on_output>);
}

void CameraStream::fail(GstStreamError code, const std::string& text) {
  if (!first_error()) return;
  listener_.on_error(GST_STREAM_ERROR, code, place() + ": " + text);
}

// Frames of another size than the rig's would be rendered as if they were of that size.
void CameraStream::check_size(GstCaps* caps) {
  GstVideoInfo info;
  const GstStructure* structure = gst_caps_get_structure(caps, 0);
  is_jpeg_ = gst_structure_has_name(structure, "image/jpeg");
  gst_structure_get_fraction(structure, "framerate", &fps_n_, &fps_d_);
  // Containers may claim any size of JPEG (Matroska without one: 1x1). check_jpeg() looks into the picture.
  if (is_jpeg_ || !gst_video_info_from_caps(&info, caps) || info.width == 0) return;
  size_is_wrong_ = info.width != options_.width || info.height != options_.height;
  if (size_is_wrong_)
    fail(GST_STREAM_ERROR_FORMAT, "the picture is " + size_text(info.width, info.height) + ", the rig says " +
                                      size_text(options_.width, options_.height));
}

// Checks the first JPEG picture that is intact: caps may say nothing of the size, and nothing of the kind of JPEG.
void CameraStream::check_jpeg(GstBuffer* buffer) {
  const MappedBuffer bytes(buffer);
  std::string reason;
  bool unsupported = false;
  const auto header = jpeg::parse_header(bytes.bytes(), &reason, &unsupported);
  if (!header && !unsupported) return;  // damaged: the next one tells
  is_known_jpeg_ = true;
  size_is_wrong_ = !header || header->width != options_.width || header->height != options_.height;
  if (!header) {
    fail(GST_STREAM_ERROR_FORMAT, reason);
  } else if (size_is_wrong_) {
    fail(GST_STREAM_ERROR_FORMAT, "the picture is " + size_text(header->width, header->height) + ", the rig says " +
                                      size_text(options_.width, options_.height));
  }
}

void CameraStream::stamp_arrivals(GstElement* multipartdemux) {
  live_ = stamps_arrival_ = true;
  // Else decodebin waits for further streams until its queue is full, which takes small pictures many seconds.
  g_object_set(multipartdemux, "single-stream", TRUE, nullptr);
  const GClosureNotify free = [](gpointer data, GClosure*) { delete static_cast<std::weak_ptr<CameraStream>*>(data); };
  g_signal_connect_data(multipartdemux, "pad-added", G_CALLBACK(+[](GstElement*, GstPad* pad, gpointer stream) {
                          add_probe(pad, GST_PAD_PROBE_TYPE_BUFFER, call<&CameraStream::on_arrival>,
                                    *static_cast<std::weak_ptr<CameraStream>*>(stream));
                        }),
                        new std::weak_ptr(weak_from_this()), free, GConnectFlags(0));
}

GstPadProbeReturn CameraStream::on_arrival(GstPad* pad, GstPadProbeInfo* info) {
  if (!GST_BUFFER_PTS_IS_VALID(GST_PAD_PROBE_INFO_BUFFER(info)))
    info->data = stamp_arrival(pad, static_cast<GstBuffer*>(info->data));
  return GST_PAD_PROBE_OK;
}

// Raw pictures have been turned as the film says (camera_chain.cc): nobody behind turns them again.
GstPadProbeReturn CameraStream::on_tags(GstPadProbeInfo* info) {
  auto* event = static_cast<GstEvent*>(info->data);
  GstTagList* tags = nullptr;
  gst_event_parse_tag(event, &tags);
  GstVideoOrientationMethod turn = GST_VIDEO_ORIENTATION_IDENTITY;
  if (!gst_video_orientation_from_tag(tags, &turn)) return GST_PAD_PROBE_OK;
  if (is_jpeg_ && turn != GST_VIDEO_ORIENTATION_IDENTITY)
    fail(GST_STREAM_ERROR_FORMAT,
         "it is a film of JPEG pictures that are to be turned, which takes decode=true (or turn them with ffmpeg)");
  GstTagList* others = gst_tag_list_copy(tags);
  gst_tag_list_remove_tag(others, GST_TAG_IMAGE_ORIENTATION);
  GstEvent* without = gst_event_new_tag(others);
  gst_event_set_seqnum(without, gst_event_get_seqnum(event));
  gst_event_unref(event);
  info->data = without;
  return GST_PAD_PROBE_OK;
}

void CameraStream::stop() {
  stopping_ = true;
  std::lock_guard wait_for_seek(seeking_);
}

GstPadProbeReturn CameraStream::on_decoded(GstPad* pad, GstPadProbeInfo* info) {
  if (info->type & GST_PAD_PROBE_TYPE_BUFFER) {
    if (is_jpeg_ && !is_known_jpeg_) check_jpeg(GST_PAD_PROBE_INFO_BUFFER(info));
    if (counts_time_)
      info->data = stamp(static_cast<GstBuffer*>(info->data));
    else if (!GST_BUFFER_PTS_IS_VALID(GST_PAD_PROBE_INFO_BUFFER(info)))
      info->data = stamp_arrival(pad, static_cast<GstBuffer*>(info->data));
    ++pictures_;
    return size_is_wrong_ ? refuse(info, GST_FLOW_ERROR) : GST_PAD_PROBE_OK;
  }
  GstEvent* event = GST_PAD_PROBE_INFO_EVENT(info);
  const bool looping = loop_seqnum_ != GST_SEQNUM_INVALID && gst_event_get_seqnum(event) == loop_seqnum_;
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_CAPS: {
      GstCaps* caps = nullptr;
      gst_event_parse_caps(event, &caps);
      check_size(caps);
      return GST_PAD_PROBE_OK;
    }
    case GST_EVENT_TAG: return on_tags(info);
    case GST_EVENT_FLUSH_START:
      return looping ? GST_PAD_PROBE_DROP : GST_PAD_PROBE_OK;  // downstream the stream just goes on
    case GST_EVENT_FLUSH_STOP:
      if (looping) return GST_PAD_PROBE_DROP;
      loop_seqnum_ = GST_SEQNUM_INVALID;  // it does not begin again, but is where it was sought
      round_start_ = stream_end_ = film_start_ = film_end_ = 0;
      told_begin_ = told_end_ = GST_CLOCK_TIME_NONE;
      return GST_PAD_PROBE_OK;
    case GST_EVENT_SEGMENT:
      if (is_jpeg_) info->data = time_segment(event);
      if (options_.catches_up && pictures_ == 0 && round_start_ == 0) pass_rounds();
      if (round_start_ > 0) info->data = later_segment(static_cast<GstEvent*>(info->data));
      return GST_PAD_PROBE_OK;
    case GST_EVENT_SEGMENT_DONE:
    case GST_EVENT_EOS:
      if (pictures_ == 0) fail(GST_STREAM_ERROR_DECODE, "there is no picture in it");
      count_dropped();
      is_cut_off_ = !ending_ && gst_pad_get_last_flow_return(chain_.out) == GST_FLOW_OK;
      if (begin_again(GST_EVENT_TYPE(event) == GST_EVENT_EOS)) return GST_PAD_PROBE_DROP;
      if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT_DONE && options_.seek_to_loop) info->data = as_end(event);
      return GST_PAD_PROBE_OK;
    default: return GST_PAD_PROBE_OK;
  }
}

// Notes the running time of a frame as it was taken, before its stamp may be changed to that of another frame rate.
GstPadProbeReturn CameraStream::on_frame(GstPad* pad, GstPadProbeInfo* info) {
  if (info->type & GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM) {
    GstEvent* event = GST_PAD_PROBE_INFO_EVENT(info);
    if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT) gst_event_copy_segment(event, &segment_);
    return GST_PAD_PROBE_OK;
  }
  auto* buffer = static_cast<GstBuffer*>(info->data);
  const GstClockTime stamp = gst_segment_to_running_time(&segment_, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
  ++round_frames_;
  if (!GST_CLOCK_TIME_IS_VALID(stamp)) return GST_PAD_PROBE_OK;
  if (options_.paced || options_.catches_up) due_ = stamp;
  const GstClockTime last_duration = stamp > stream_end_ ? stamp - stream_end_ : 0;
  const GstClockTime duration = GST_BUFFER_DURATION_IS_VALID(buffer) ? GST_BUFFER_DURATION(buffer) : last_duration;
  stream_end_ = stamp + duration;
  note_position(GST_BUFFER_PTS(buffer) + duration);
  if (live_ && is_shed(pad, buffer, stamp)) return GST_PAD_PROBE_DROP;

  // Of a film it is where in the film the frame is, which a seek does not begin anew.
  GstClockTime taken = stamp;
  if (!live_) {
    taken = gst_segment_to_stream_time(&segment_, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
    if (!GST_CLOCK_TIME_IS_VALID(taken)) return GST_PAD_PROBE_OK;
    taken += film_start_;
    film_end_ = taken + duration;
  }
  buffer = gst_buffer_make_writable(buffer);
  GstCaps* reference = capture_time_reference();
  gst_buffer_add_reference_timestamp_meta(buffer, reference, taken, GST_BUFFER_DURATION(buffer));
  gst_caps_unref(reference);
  info->data = buffer;
  return GST_PAD_PROBE_OK;
}

// Whether a live frame is left out because the machine can't decode all.
bool CameraStream::is_shed(GstPad* pad, GstBuffer* buffer, GstClockTime stamp) {
  const GstClockTime now = gst_element_get_current_running_time(owner_);
  if (!GST_CLOCK_TIME_IS_VALID(now)) return false;
  constexpr guint64 kEvery = 30;  // frames: latency may change, if not often
  if (judged_++ % kEvery == 0) latency_ = live_latency(chain_.decoded).value_or(0);
  const GstClockTime period = GST_BUFFER_DURATION_IS_VALID(buffer) ? GST_BUFFER_DURATION(buffer) : 0;
  using Verdict = CameraShedder::Verdict;
  const Verdict verdict =
      options_.shedder->see(GST_BUFFER_PTS(buffer), GST_CLOCK_DIFF(stamp, now), latency_, period, now_ns());
  if (verdict == Verdict::kBeginToDrop) {
    gst_pad_push_event(pad, gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM, gst_structure_new_empty(LF_CAMERA_LOST)));
    listener_.on_overload(options_.shedder->behind());
  }
  return verdict != Verdict::kShow;
}

// What was dropped has its place in the stream all the same.
void CameraStream::count_dropped() {
  const GstClockTime end = options_.shedder->take_dropped_end();
  if (!GST_CLOCK_TIME_IS_VALID(end)) return;
  ++round_frames_;
  const GstClockTime stamp = gst_segment_to_running_time(&segment_, GST_FORMAT_TIME, end);
  if (GST_CLOCK_TIME_IS_VALID(stamp)) stream_end_ = std::max(stream_end_, stamp);
  note_position(end);
}

void CameraStream::note_position(GstClockTime end) {
  const GstClockTime position = gst_segment_to_stream_time(&segment_, GST_FORMAT_TIME, end);
  if (GST_CLOCK_TIME_IS_VALID(position)) position_ = position;
}

// Of a live frame's running time. Of one that a sender dates itself: when it was taken and not when it came.
GstClockTime CameraStream::clock_time(GstClockTime stamp) const {
  const std::optional<GstClockTime> taken = chain_.sender ? chain_.sender->taken(stamp) : std::nullopt;
  g_autoptr(GstClock) clock = taken ? gst_element_get_clock(owner_) : nullptr;
  if (!clock) return stamp + gst_element_get_base_time(owner_);
  const GstClockTime now = static_cast<GstClockTime>(g_get_real_time()) * GST_USECOND;
  return static_cast<GstClockTime>(static_cast<GstClockTimeDiff>(gst_clock_get_time(clock)) -
                                   GST_CLOCK_DIFF(*taken, now));
}

// The true one, of a frame that was taken at a running time, or where in a film. While a live frame waits for PLAYING
// there is no base time.
GstClockTime CameraStream::capture_time(GstClockTime taken) const {
  if (live_) taken = clock_time(taken);
  const auto offset = static_cast<GstClockTimeDiff>(options_.time_offset * GST_SECOND);
  const bool before_zero = offset < 0 && taken < static_cast<GstClockTime>(-offset);
  return before_zero ? 0 : taken + offset;
}

// Only where a frame is sent.
GstBuffer* CameraStream::complete_capture_time(GstBuffer* buffer) const {
  buffer = gst_buffer_make_writable(buffer);
  GstCaps* reference = capture_time_reference();
  GstReferenceTimestampMeta* meta = gst_buffer_get_reference_timestamp_meta(buffer, reference);
  gst_caps_unref(reference);
  if (!meta) return buffer;  // a frame without a stamp
  meta->timestamp = capture_time(meta->timestamp);
  return buffer;
}

// What is sent of a camera whose coded pictures are not kept.
void CameraStream::keep_frame(GstPad* pad, GstBuffer* frame) const {
  if (!listener_.on_keepsake) return;
  if (const std::lock_guard lock(keeping_); coded_pad_) return;
  GstCaps* reference = capture_time_reference();
  const GstReferenceTimestampMeta* meta = gst_buffer_get_reference_timestamp_meta(frame, reference);
  gst_caps_unref(reference);
  g_autoptr(GstCaps) caps = meta ? gst_pad_get_current_caps(pad) : nullptr;
  if (caps) listener_.on_keepsake(frame, caps, meta->timestamp);
}

void CameraStream::announce(GstPad* pad) {
  if (announced_) return;
  announced_ = true;
  GstStructure* camera =
      gst_structure_new(LF_CAMERA_EVENT, "camera", G_TYPE_UINT, options_.camera, "rig-hash", G_TYPE_UINT64,
                        options_.rig_hash, "paced", G_TYPE_BOOLEAN, options_.paced, nullptr);
  gst_pad_push_event(pad, gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM_STICKY, camera));
}

GstPadProbeReturn CameraStream::on_output_event(GstPad* pad, GstEvent* event) {
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_QOS:
      // Who is late in files still gets all frames: a picture must not depend on the speed of the machine.
      return live_ ? GST_PAD_PROBE_OK : GST_PAD_PROBE_DROP;
    case GST_EVENT_SEGMENT:  // the first one, one after a flush, or the next round
      announced_ = eos_sent_ = false;
      if (!sought_.exchange(false)) return GST_PAD_PROBE_OK;
      frames_out_ = 0;
      ending_ = false;
      return GST_PAD_PROBE_OK;
    case GST_EVENT_GAP: announce(pad); return GST_PAD_PROBE_OK;
    case GST_EVENT_EOS:
      if (eos_sent_) return GST_PAD_PROBE_DROP;
      eos_sent_ = true;
      announce(pad);
      return on_output_end(pad);
    default: return GST_PAD_PROBE_OK;
  }
}

GstPadProbeReturn CameraStream::on_output_end(GstPad* pad) {
  has_ended_ = true;
  if (!options_.has_end && is_cut_off_) fail(GST_STREAM_ERROR_FAILED, "its stream ended");
  if (!failed_) listener_.on_end();
  if (!failed_ || !options_.may_be_lost) return GST_PAD_PROBE_OK;
  gst_pad_push_event(pad, gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM, gst_structure_new_empty(LF_CAMERA_LOST)));
  return GST_PAD_PROBE_DROP;
}

// A film that is opened again stays in step with the others: it runs through what they have shown since.
// Viewers would wait for late frames, as capture delays follow how late the latest frames come. A stream that is late
// by less than a second, and not on time another second later, is on a machine that can't do better.
bool CameraStream::is_too_late(GstBuffer* buffer) {
  constexpr GstClockTime kLate = GST_SECOND / 20, kPatience = GST_SECOND;
  if (!options_.catches_up || is_on_time_) return false;
  const GstClockTime now = gst_element_get_current_running_time(owner_);
  const GstClockTime stamp = gst_segment_to_running_time(&segment_, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
  is_on_time_ = !GST_CLOCK_TIME_IS_VALID(now) || !GST_CLOCK_TIME_IS_VALID(stamp) || stamp + kLate >= now;
  if (!is_on_time_ && stamp + GST_SECOND >= now) {
    if (nearly_since_ == 0) nearly_since_ = now;
    is_on_time_ = now >= nearly_since_ + kPatience;
  }
  left_out_ += !is_on_time_;
  return !is_on_time_;
}

GstPadProbeReturn CameraStream::on_output(GstPad* pad, GstPadProbeInfo* info) {
  if (!(info->type & GST_PAD_PROBE_TYPE_BUFFER)) {
    GstEvent* event = GST_PAD_PROBE_INFO_EVENT(info);
    return GST_EVENT_TYPE(event) == GST_EVENT_SEEK ? on_seek(info) : on_output_event(pad, event);
  }
  if (options_.num_frames >= 0 && frames_out_ >= options_.num_frames) ending_ = true;
  if (ending_) {
    // The source stops then; not every one also tells downstream (decodebin's queues don't).
    gst_pad_push_event(pad, gst_event_new_eos());
    return refuse(info, GST_FLOW_EOS);
  }
  if (is_too_late(GST_PAD_PROBE_INFO_BUFFER(info))) return GST_PAD_PROBE_DROP;
  info->data = complete_capture_time(static_cast<GstBuffer*>(info->data));
  announce(pad);
  if (frames_out_++ == 0) {
    listener_.on_first_frame();
    keep_waiting();
  }
  keep_frame(pad, GST_PAD_PROBE_INFO_BUFFER(info));
  return GST_PAD_PROBE_OK;
}

// --- What is kept of a camera ----------------------------------------------------------------------------------------
//
// Its pictures as it has coded them, seen before they are decoded, or its frames.

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

// --- Where in its film a camera is that is read from files -----------------------------------------------------------
//
// Seeks, rounds, and stamps where a source has none, so that capture times stay those of the film, whatever the source
// is.
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
  if (!options_.seek_to_loop) return GST_PAD_PROBE_OK;
  // What is in a later round of a film that loops is come to from the beginning.
  gint64 duration = 0;
  if (gst_pad_peer_query_duration(chain_.decoded, GST_FORMAT_TIME, &duration) && start >= duration) start = 0;
  GstEvent* there = gst_event_new_seek(rate, format, flags, start_type, start, stop_type, stop);
  gst_event_set_seqnum(there, seqnum);
  // Here, because it and the one back to the beginning have to follow each other, and that is not done once it is.
  return gst_pad_push_event(chain_.decoded, there) ? GST_PAD_PROBE_DROP : GST_PAD_PROBE_OK;
}

// Behind the end of a segment the stream goes on without a flush. Only behind EOS, which ends what has begun without a
// seek, there has to be one.
void CameraStream::seek_to_start(guint32 seqnum, bool flush) {
  std::lock_guard lock(seeking_);
  if (stopping_ || loop_seqnum_ != seqnum) return;
  const int flags = GST_SEEK_FLAG_SEGMENT | (flush ? GST_SEEK_FLAG_FLUSH : 0);
  GstEvent* seek =
      gst_event_new_seek(1.0, GST_FORMAT_TIME, GstSeekFlags(flags), GST_SEEK_TYPE_SET, 0, GST_SEEK_TYPE_NONE, -1);
  gst_event_set_seqnum(seek, seqnum);
  if (!gst_pad_push_event(chain_.decoded, seek))
    fail(GST_STREAM_ERROR_FAILED, "can't begin again: there is no seeking in it");
}

// A film that loops and is opened again begins in the round that it would be in, not in the first of all: after hours
// nobody could decode what there has been since. Rounds are as long as they were found to be, so that it stays in step.
void CameraStream::pass_rounds() {
  gint64 duration = static_cast<gint64>(round_);
  const GstClockTime now = gst_element_get_current_running_time(owner_);
  if (!options_.seek_to_loop || !GST_CLOCK_TIME_IS_VALID(now)) return;
  if (duration == 0) gst_pad_peer_query_duration(chain_.decoded, GST_FORMAT_TIME, &duration);
  if (duration > 0) round_start_ = stream_end_ = now - now % static_cast<guint64>(duration);
}

// How much earlier than at the end that it says to have the film has ended; 0 for what is no more than a frame or two.
GstClockTime CameraStream::missing_at_end() const {
  gint64 duration = 0;
  if (!gst_pad_peer_query_duration(chain_.decoded, GST_FORMAT_TIME, &duration) || duration <= 0) return 0;
  const GstClockTime period = round_frames_ > 0 ? (stream_end_ - round_start_) / round_frames_ : 0;
  const auto said = static_cast<GstClockTime>(duration);
  const bool is_shorter = said > position_ + 2 * period + GST_SECOND / 50;
  return is_shorter && !has_sound(GST_BIN(owner_)) ? said - position_ : 0;  // which may be longer
}

// The last frame lasts until the end that its file tells, so that all cameras of a recording have rounds of one length.
void CameraStream::end_round_as_told() {
  told_begin_ = GST_CLOCK_TIME_NONE;
  const GstClockTime told = told_end_.exchange(GST_CLOCK_TIME_NONE);
  if (!GST_CLOCK_TIME_IS_VALID(told)) return;
  const GstClockTimeDiff later = GST_CLOCK_DIFF(position_, told);
  stream_end_ = static_cast<GstClockTime>(static_cast<GstClockTimeDiff>(stream_end_) + later);
  film_end_ = static_cast<GstClockTime>(static_cast<GstClockTimeDiff>(film_end_) + later);
  position_ = told;
}

// At the end of the file, or of a segment: true if it is to begin again.
bool CameraStream::begin_again(bool flush) {
  // Nobody wants more frames, or the file has none: no reason to turn round and round.
  if (!options_.seek_to_loop || !is_cut_off_ || failed_ || round_frames_ == 0) return false;
  if (stamps_arrival_ || live_latency(chain_.decoded)) return false;  // no beginning to seek back to

  // A film that is cut off, or whose last frames were dropped, has none for the rest of its round, so that those after
  // it are in step with the others'.
  end_round_as_told();
  const GstClockTime missing = missing_at_end();
  const bool dropped = options_.shedder->dropped() != std::exchange(dropped_before_, options_.shedder->dropped());
  if (missing > 0 && !dropped && !std::exchange(told_cut_off_, true)) listener_.on_cut_off(position_, missing);
  stream_end_ += missing;
  film_end_ += missing;
  if (options_.paced || options_.catches_up) due_ = stream_end_;
  round_ = stream_end_ - round_start_;
  round_start_ = stream_end_;
  film_start_ = film_end_;
  round_frames_ = 0;
  loop_seqnum_ = gst_util_seqnum_next();

  // On another thread: a seek waits until this one has let go.
  struct Task {
    std::shared_ptr<CameraStream> stream;
    guint32 seqnum;
    bool flush;
    GstPad* pad;  // so that it is still there, if not in use any more
  };
  gst_element_call_async(
      owner_,
      [](GstElement* owner, gpointer data) {
        const auto* task = static_cast<Task*>(data);
        guarded(owner, 0, [task] { return task->stream->seek_to_start(task->seqnum, task->flush), 0; });
      },
      new Task{shared_from_this(), loop_seqnum_, flush, GST_PAD(gst_object_ref(chain_.decoded))},
      [](gpointer data) {
        auto* task = static_cast<Task*>(data);
        gst_object_unref(task->pad);
        delete task;
      });
  return true;
}

// The same segment, `round_start_` later: running time goes on where the last round ended. Takes and gives a reference.
GstEvent* CameraStream::later_segment(GstEvent* event) const {
  GstSegment segment;
  gst_event_copy_segment(event, &segment);
  segment.base = round_start_;
  segment.flags = GstSegmentFlags(segment.flags & ~GST_SEGMENT_FLAG_RESET);
  GstEvent* later = gst_event_new_segment(&segment);
  gst_event_set_seqnum(later, gst_event_get_seqnum(event));
  gst_event_unref(event);
  return later;
}

// JPEG files that elements read one by one (multifilesrc) are stretches of bytes without times. Takes and gives a
// reference.
GstEvent* CameraStream::time_segment(GstEvent* event) {
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event, &segment);
  counts_time_ = segment->format != GST_FORMAT_TIME && fps_n_ > 0;
  if (!counts_time_) return event;
  GstSegment time;
  gst_segment_init(&time, GST_FORMAT_TIME);
  GstEvent* timed = gst_event_new_segment(&time);
  gst_event_set_seqnum(timed, gst_event_get_seqnum(event));
  gst_event_unref(event);
  return timed;
}

// The running time now; 0 before PLAYING, while a first frame waits there.
GstClockTime CameraStream::running_time_now() const {
  const GstClockTime now = gst_element_get_current_running_time(owner_);
  return GST_CLOCK_TIME_IS_VALID(now) ? now : 0;
}

// Gives a picture that has no stamp the time at which it arrives. Takes and gives a reference.
GstBuffer* CameraStream::stamp_arrival(GstPad* pad, GstBuffer* buffer) const {
  g_autoptr(GstEvent) event = gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0);
  const GstSegment* segment = nullptr;
  if (event) gst_event_parse_segment(event, &segment);
  if (!segment || segment->format != GST_FORMAT_TIME) return buffer;
  buffer = gst_buffer_make_writable(buffer);
  GST_BUFFER_PTS(buffer) = gst_segment_position_from_running_time(segment, GST_FORMAT_TIME, running_time_now());
  GST_BUFFER_DTS(buffer) = GST_CLOCK_TIME_NONE;
  return buffer;
}

GstBuffer* CameraStream::stamp(GstBuffer* buffer) const {
  buffer = gst_buffer_make_writable(buffer);
  const auto time = [this](guint64 n) {
    return gst_util_uint64_scale(n, GST_SECOND * static_cast<guint64>(fps_d_), static_cast<guint64>(fps_n_));
  };
  GST_BUFFER_PTS(buffer) = time(pictures_);
  GST_BUFFER_DTS(buffer) = GST_CLOCK_TIME_NONE;
  GST_BUFFER_DURATION(buffer) = time(pictures_ + 1) - time(pictures_);
  return buffer;
}

}  // namespace lf
