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
#include "camsrc/cam_src_children.h"
#include "camsrc/camera_chain.h"
#include "common/codecs.h"
#include "common/common.h"
#include "common/gst_wire.h"
#include "common/guard.h"
#include "image/image_file.h"
#include "jpeg/header.h"

namespace lf {

bool PendingCodedFrames::admits(GstBuffer* picture) {
  has_key_ = has_key_ || !GST_BUFFER_FLAG_IS_SET(picture, GST_BUFFER_FLAG_DELTA_UNIT);
  return has_key_;
}

void PendingCodedFrames::begin_again() {
  has_key_ = false;
  waiting_.clear();
}

void PendingCodedFrames::wait(GstBuffer* picture, GstClockTime taken) {
  if (waiting_.size() >= kMaxPending) begin_again();
  if (admits(picture)) waiting_.push_back({BufferPtr(gst_buffer_ref(picture)), taken});
}

std::vector<PendingCodedFrames::Picture> PendingCodedFrames::take_waiting() { return std::exchange(waiting_, {}); }

GstClockTime PendingCodedFrames::in_order(GstClockTime taken, GstClockTime captured) {
  constexpr GstClockTime kLeast = 10 * GST_USECOND;  // timestamp granularity of the file
  const bool is_newest = taken > newest_taken_;
  if (!is_newest) return captured;
  if (newest_captured_ > 0 && captured <= newest_captured_ && newest_captured_ - captured < kMaxReorder)
    captured = newest_captured_ + kLeast;
  newest_taken_ = taken;
  newest_captured_ = captured;
  return captured;
}

namespace {

// Drops the buffer of a probe and returns `reason` upstream.
GstPadProbeReturn refuse(GstPadProbeInfo* info, GstFlowReturn reason) {
  gst_clear_buffer(reinterpret_cast<GstBuffer**>(&info->data));
  GST_PAD_PROBE_INFO_FLOW_RETURN(info) = reason;
  return GST_PAD_PROBE_HANDLED;
}

// Replaces the event of a probe by another one with the same sequence number. Takes the new event.
void replace_event(GstPadProbeInfo* info, GstEvent* event) {
  auto* before = static_cast<GstEvent*>(info->data);
  gst_event_set_seqnum(event, gst_event_get_seqnum(before));
  gst_event_unref(before);
  info->data = event;
}

const GstSegment& segment_of(GstPadProbeInfo* info) {
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(GST_PAD_PROBE_INFO_EVENT(info), &segment);
  return *segment;
}

}  // namespace

CameraStream::CameraStream(LfCamSrc* owner, const CameraChain& chain, const StreamOptions& options)
    : camera_(owner),
      owner_(GST_ELEMENT(owner)),
      chain_(chain),
      options_(options),
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

// Calls the method for the data of the pad. The pointer to the stream is weak, because events from downstream may
// arrive while the chain is being removed.
void CameraStream::watch_pad(GstPad* pad, int type,
                             GstPadProbeReturn (CameraStream::*method)(GstPad*, GstPadProbeInfo*)) {
  add_probe(pad, type, [weak = weak_from_this(), method](GstPad* at, GstPadProbeInfo* info) {
    const std::shared_ptr<CameraStream> stream = weak.lock();
    return stream ? ((*stream).*method)(at, info) : GST_PAD_PROBE_OK;
  });
}

void CameraStream::watch_element(GstElement* element) {
  GstElementFactory* factory = gst_element_get_factory(element);
  if (factory && g_str_equal(GST_OBJECT_NAME(factory), "jpegdec")) {
    g_autoptr(GstPad) sink = gst_element_get_static_pad(element, "sink");
    watch_pad(sink, GST_PAD_PROBE_TYPE_BUFFER, &CameraStream::on_jpeg);
  }
  const bool is_parser =
      options_.seek_to_loop && factory && gst_element_factory_list_is_type(factory, GST_ELEMENT_FACTORY_TYPE_PARSER);
  if (!is_parser && (!options_.tap || !GST_IS_VIDEO_DECODER(element))) return;
  g_autoptr(GstPad) sink = gst_element_get_static_pad(element, "sink");
  if (!sink) return;
  watch_pad(sink, GST_PAD_PROBE_TYPE_BUFFER, is_parser ? &CameraStream::on_parsed : &CameraStream::on_coded);
}

void CameraStream::watch() {
  constexpr auto kData = GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM;
  watch_pad(chain_.decoded, kData | GST_PAD_PROBE_TYPE_EVENT_FLUSH, &CameraStream::on_decoded);
  watch_pad(chain_.frames, kData, &CameraStream::on_frame);
  watch_pad(chain_.out, kData | GST_PAD_PROBE_TYPE_EVENT_UPSTREAM, &CameraStream::on_output);
}

void CameraStream::fail(GstStreamError code, const std::string& text) {
  if (!first_error()) return;
  lf_cam_src_fail(camera_, {GST_STREAM_ERROR, code, place() + ": " + text, ""});
  lf_cam_src_shut_down(camera_, options_.serial);
}

// Ends the stream if a frame has another size than the rig states, because frames of a wrong size would be rendered
// with wrong geometry.
void CameraStream::require_size(int width, int height) {
  size_is_wrong_ = width != options_.width || height != options_.height;
  if (size_is_wrong_)
    fail(GST_STREAM_ERROR_FORMAT,
         "the picture is " + size_text(width, height) + ", the rig says " + size_text(options_.width, options_.height));
}

void CameraStream::check_size(GstCaps* caps) {
  GstVideoInfo info;
  const GstStructure* structure = gst_caps_get_structure(caps, 0);
  is_jpeg_ = gst_structure_has_name(structure, "image/jpeg");
  gst_structure_get_fraction(structure, "framerate", &fps_n_, &fps_d_);
  // Skips JPEG, because caps of containers are unreliable there (Matroska without size: 1x1). check_jpeg() parses the
  // picture instead.
  if (is_jpeg_ || !gst_video_info_from_caps(&info, caps) || info.width == 0) return;
  require_size(info.width, info.height);
}

// Checks the size in the first intact JPEG picture, because the caps may lack size and JPEG type.
void CameraStream::check_jpeg(GstBuffer* buffer) {
  const MappedBuffer bytes(buffer);
  std::string reason;
  bool unsupported = false;
  const auto header = jpeg::parse_header(bytes.bytes(), &reason, &unsupported);
  if (!header && !unsupported) return;  // damaged: check the next picture
  is_known_jpeg_ = true;
  if (header) return require_size(header->width, header->height);
  size_is_wrong_ = true;
  fail(GST_STREAM_ERROR_FORMAT, reason);
}

void CameraStream::stamp_arrivals(GstElement* multipartdemux) {
  live_ = stamps_arrival_ = true;
  // Without this, decodebin would wait for further streams until its queue is full, which takes many seconds for small
  // pictures.
  g_object_set(multipartdemux, "single-stream", TRUE, nullptr);
  const GClosureNotify free = [](gpointer data, GClosure*) { delete static_cast<std::weak_ptr<CameraStream>*>(data); };
  g_signal_connect_data(multipartdemux, "pad-added", G_CALLBACK(+[](GstElement*, GstPad* pad, gpointer stream) {
                          if (const auto self = static_cast<std::weak_ptr<CameraStream>*>(stream)->lock())
                            self->watch_pad(pad, GST_PAD_PROBE_TYPE_BUFFER, &CameraStream::on_arrival);
                        }),
                        new std::weak_ptr(weak_from_this()), free, GConnectFlags(0));
}

GstPadProbeReturn CameraStream::on_arrival(GstPad* pad, GstPadProbeInfo* info) {
  if (!GST_BUFFER_PTS_IS_VALID(GST_PAD_PROBE_INFO_BUFFER(info)))
    info->data = stamp_arrival(pad, static_cast<GstBuffer*>(info->data));
  return GST_PAD_PROBE_OK;
}

// Removes the orientation tag of raw pictures, which are already rotated (camera_chain.cc), so that downstream does not
// rotate them again.
GstPadProbeReturn CameraStream::on_tags(GstPadProbeInfo* info) {
  GstTagList* tags = nullptr;
  gst_event_parse_tag(GST_PAD_PROBE_INFO_EVENT(info), &tags);
  GstVideoOrientationMethod turn = GST_VIDEO_ORIENTATION_IDENTITY;
  if (!gst_video_orientation_from_tag(tags, &turn)) return GST_PAD_PROBE_OK;
  if (is_jpeg_ && turn != GST_VIDEO_ORIENTATION_IDENTITY)
    fail(GST_STREAM_ERROR_FORMAT,
         "the JPEG pictures of this film need a rotation: set decode=true, or rotate the film with ffmpeg");
  GstTagList* others = gst_tag_list_copy(tags);
  gst_tag_list_remove_tag(others, GST_TAG_IMAGE_ORIENTATION);
  replace_event(info, gst_event_new_tag(others));
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
    return size_is_wrong_ || has_no_time_ ? refuse(info, GST_FLOW_ERROR) : GST_PAD_PROBE_OK;
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
    case GST_EVENT_FLUSH_START: return looping ? GST_PAD_PROBE_DROP : GST_PAD_PROBE_OK;
    case GST_EVENT_FLUSH_STOP:
      if (looping) return GST_PAD_PROBE_DROP;
      loop_seqnum_ = GST_SEQNUM_INVALID;
      round_start_ = stream_end_ = film_start_ = film_end_ = 0;
      segment_begin_ = segment_end_ = GST_CLOCK_TIME_NONE;
      return GST_PAD_PROBE_OK;
    case GST_EVENT_SEGMENT:
      if (is_jpeg_) count_time(info);
      check_format(segment_of(info));
      if (options_.skips_late && pictures_ == 0 && round_start_ == 0) pass_rounds();
      if (round_start_ > 0) delay_segment(info);
      return GST_PAD_PROBE_OK;
    case GST_EVENT_SEGMENT_DONE:
    case GST_EVENT_EOS:
      if (pictures_ == 0) fail(GST_STREAM_ERROR_DECODE, "the source has no pictures");
      count_dropped();
      is_truncated_ = !ending_ && gst_pad_get_last_flow_return(chain_.out) == GST_FLOW_OK;
      if (begin_again(GST_EVENT_TYPE(event) == GST_EVENT_EOS)) return GST_PAD_PROBE_DROP;
      // The film is not repeated any more. Downstream expects EOS, because it has not sent the segment seek.
      if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT_DONE && options_.seek_to_loop)
        replace_event(info, gst_event_new_eos());
      return GST_PAD_PROBE_OK;
    default: return GST_PAD_PROBE_OK;
  }
}

// Stores the original running time of a frame, because a frame rate conversion may change its timestamp.
GstPadProbeReturn CameraStream::on_frame(GstPad* pad, GstPadProbeInfo* info) {
  if (info->type & GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM) {
    if (GST_EVENT_TYPE(GST_PAD_PROBE_INFO_EVENT(info)) == GST_EVENT_SEGMENT &&
        segment_of(info).format == GST_FORMAT_TIME)
      gst_segment_copy_into(&segment_of(info), &segment_);
    return GST_PAD_PROBE_OK;
  }
  auto* buffer = static_cast<GstBuffer*>(info->data);
  const GstClockTime stamp = gst_segment_to_running_time(&segment_, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
  ++round_frames_;
  if (!GST_CLOCK_TIME_IS_VALID(stamp)) return GST_PAD_PROBE_OK;
  if (options_.paced || options_.skips_late) due_ = stamp;
  const GstClockTime last_duration = stamp > stream_end_ ? stamp - stream_end_ : 0;
  const GstClockTime duration = GST_BUFFER_DURATION_IS_VALID(buffer) ? GST_BUFFER_DURATION(buffer) : last_duration;
  stream_end_ = stamp + duration;
  note_position(GST_BUFFER_PTS(buffer) + duration);
  if (live_ && is_shed(pad, buffer, stamp)) return GST_PAD_PROBE_DROP;

  // For files: the position in the film, which a seek does not reset.
  GstClockTime taken = stamp;
  if (!live_) {
    taken = gst_segment_to_stream_time(&segment_, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
    if (!GST_CLOCK_TIME_IS_VALID(taken)) return GST_PAD_PROBE_OK;
    taken += film_start_;
    film_end_ = taken + duration;
  }
  buffer = gst_buffer_make_writable(buffer);
  add_capture_time(buffer, taken, GST_BUFFER_DURATION(buffer));
  info->data = buffer;
  return GST_PAD_PROBE_OK;
}

bool CameraStream::is_shed(GstPad* pad, GstBuffer* buffer, GstClockTime stamp) {
  const GstClockTime now = gst_element_get_current_running_time(owner_);
  if (!GST_CLOCK_TIME_IS_VALID(now)) return false;
  constexpr guint64 kEvery = 30;
  if (checked_frames_++ % kEvery == 0) latency_ = live_latency(chain_.decoded).value_or(0);
  const GstClockTime period = GST_BUFFER_DURATION_IS_VALID(buffer) ? GST_BUFFER_DURATION(buffer) : 0;
  using Verdict = LoadShedder::Verdict;
  const Verdict verdict =
      options_.shedder->see(GST_BUFFER_PTS(buffer), GST_CLOCK_DIFF(stamp, now), latency_, period, now_ns());
  if (verdict == Verdict::kStartDropping) {
    gst_pad_push_event(pad, camera_lost_event());
    lf_cam_src_warn_overload(camera_, options_.shedder->behind());
  }
  return verdict != Verdict::kShow;
}

// Adds the frames that the LoadShedder has dropped at the end of a loop, because dropped frames belong to the length of
// the film, too.
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

// Converts the running time of a live frame to clock time, from RTCP sender reports if these are available.
GstClockTime CameraStream::clock_time(GstClockTime stamp) const {
  const std::optional<GstClockTime> taken = chain_.sender ? chain_.sender->taken(stamp) : std::nullopt;
  g_autoptr(GstClock) clock = taken ? gst_element_get_clock(owner_) : nullptr;
  if (!clock) return stamp + gst_element_get_base_time(owner_);
  const GstClockTime now = static_cast<GstClockTime>(g_get_real_time()) * GST_USECOND;
  return static_cast<GstClockTime>(static_cast<GstClockTimeDiff>(gst_clock_get_time(clock)) -
                                   GST_CLOCK_DIFF(*taken, now));
}

// Returns the capture time of a frame, including the time offset of the camera. `taken` is the running time of a live
// frame, or the position in the film. A live frame has no valid capture time before PLAYING, because the base time is
// not set yet.
GstClockTime CameraStream::capture_time(GstClockTime taken) const {
  if (live_) taken = clock_time(taken);
  const auto offset = static_cast<GstClockTimeDiff>(options_.time_offset * GST_SECOND);
  const bool before_zero = offset < 0 && taken < static_cast<GstClockTime>(-offset);
  return before_zero ? 0 : taken + offset;
}

GstBuffer* CameraStream::complete_capture_time(GstBuffer* buffer) const {
  buffer = gst_buffer_make_writable(buffer);
  if (GstReferenceTimestampMeta* meta = find_capture_time(buffer)) meta->timestamp = capture_time(meta->timestamp);
  return buffer;
}

void CameraStream::record_frame(GstPad* pad, GstBuffer* frame) const {
  if (!options_.tap) return;
  if (const std::lock_guard lock(recording_mutex_); coded_pad_) return;
  const GstReferenceTimestampMeta* meta = find_capture_time(frame);
  g_autoptr(GstCaps) caps = meta ? gst_pad_get_current_caps(pad) : nullptr;
  if (caps) options_.tap(frame, caps, meta->timestamp);
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
      // Removes QoS events for files, which must deliver all frames even if downstream is late. The output must not
      // depend on the speed of the machine.
      return live_ ? GST_PAD_PROBE_OK : GST_PAD_PROBE_DROP;
    case GST_EVENT_SEGMENT:
      announced_ = eos_sent_ = false;
      if (!external_seek_pending_.exchange(false)) return GST_PAD_PROBE_OK;
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
  if (!options_.has_end && is_truncated_) fail(GST_STREAM_ERROR_FAILED, "the stream ended");
  if (!failed_) camera_->service->end();
  if (!failed_ || !options_.may_be_lost) return GST_PAD_PROBE_OK;
  gst_pad_push_event(pad, camera_lost_event());
  return GST_PAD_PROBE_DROP;
}

// Drops late frames of a reopened film until the film has caught up, because late frames would increase the capture
// delay of all viewers. If the stream is less than one second late and does not catch up within another second, the
// machine is too slow, and frames are accepted.
bool CameraStream::is_too_late(GstBuffer* buffer) {
  constexpr GstClockTime kLate = GST_SECOND / 20, kSettleTime = GST_SECOND;
  if (!options_.skips_late || is_on_time_) return false;
  const GstClockTime now = gst_element_get_current_running_time(owner_);
  const GstClockTime stamp = gst_segment_to_running_time(&segment_, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
  is_on_time_ = !GST_CLOCK_TIME_IS_VALID(now) || !GST_CLOCK_TIME_IS_VALID(stamp) || stamp + kLate >= now;
  if (!is_on_time_ && stamp + GST_SECOND >= now) {
    if (nearly_since_ == 0) nearly_since_ = now;
    is_on_time_ = now >= nearly_since_ + kSettleTime;
  }
  skipped_frames_ += !is_on_time_;
  return !is_on_time_;
}

GstPadProbeReturn CameraStream::on_output(GstPad* pad, GstPadProbeInfo* info) {
  if (!(info->type & GST_PAD_PROBE_TYPE_BUFFER)) {
    GstEvent* event = GST_PAD_PROBE_INFO_EVENT(info);
    return GST_EVENT_TYPE(event) == GST_EVENT_SEEK ? on_seek(info) : on_output_event(pad, event);
  }
  if (options_.num_buffers >= 0 && frames_out_ >= options_.num_buffers) ending_ = true;
  if (ending_) {
    // Ends the stream here, because not every source also sends EOS downstream. For example, the queues of decodebin do
    // not.
    gst_pad_push_event(pad, gst_event_new_eos());
    return refuse(info, GST_FLOW_EOS);
  }
  if (is_too_late(GST_PAD_PROBE_INFO_BUFFER(info))) return GST_PAD_PROBE_DROP;
  info->data = complete_capture_time(static_cast<GstBuffer*>(info->data));
  announce(pad);
  if (frames_out_++ == 0) {
    if (camera_->service->find(now_ns())) lf_cam_src_post_found(camera_);
    record_pending();
  }
  record_frame(pad, GST_PAD_PROBE_INFO_BUFFER(info));
  return GST_PAD_PROBE_OK;
}

// --- Recording -------------------------------------------------------------------------------------------------------
//
// A recording receives coded pictures in front of the decoder, and all other video as output frames.

// Returns the running time (live) or film time of a picture with this timestamp. Pictures before the segment are valid,
// because later pictures may refer to these pictures.
std::optional<GstClockTime> CameraStream::taken_at(GstSegment segment, GstClockTime stamp) const {
  if (segment.format != GST_FORMAT_TIME || !GST_CLOCK_TIME_IS_VALID(stamp)) return std::nullopt;
  if (round_start_ > 0) segment.base = round_start_;
  guint64 time = 0;
  const int sign = live_ ? gst_segment_to_running_time_full(&segment, GST_FORMAT_TIME, stamp, &time)
                         : gst_segment_to_stream_time_full(&segment, GST_FORMAT_TIME, stamp, &time);
  if (sign == 0) return std::nullopt;
  const gint64 taken = (sign < 0 ? -1 : 1) * static_cast<gint64>(time) + (live_ ? 0 : static_cast<gint64>(film_start_));
  return static_cast<GstClockTime>(std::max<gint64>(taken, 0));
}

// Passes a coded picture to the recording. Pictures wait until the first output frame, because the capture time of a
// live picture and the position of a reopened film are not certain before.
GstPadProbeReturn CameraStream::on_coded(GstPad* pad, GstPadProbeInfo* info) {
  GstBuffer* picture = GST_PAD_PROBE_INFO_BUFFER(info);
  g_autoptr(GstCaps) caps = gst_pad_get_current_caps(pad);
  if (!caps || !find_coded_video(caps) || is_rotated(pad)) return GST_PAD_PROBE_OK;
  const std::lock_guard lock(recording_mutex_);
  if (!coded_pad_) coded_pad_ = GST_PAD(gst_object_ref(pad));
  g_autoptr(GstEvent) event = pad == coded_pad_ ? gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0) : nullptr;
  if (!event) return GST_PAD_PROBE_OK;
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event, &segment);
  const std::optional<GstClockTime> taken = taken_at(*segment, GST_BUFFER_PTS(picture));
  if (frames_out_ == 0 && options_.skips_late)
    coded_.begin_again();
  else if (!taken)
    return GST_PAD_PROBE_OK;
  else if (frames_out_ == 0)
    coded_.wait(picture, *taken);
  else if (coded_.admits(picture))
    options_.tap(picture, caps, coded_.in_order(*taken, capture_time(*taken)));
  return GST_PAD_PROBE_OK;
}

// Drops truncated pictures, which jpegdec would fill with grey without an error. Some cameras never write the end
// marker, so this check begins after the first picture with a marker.
GstPadProbeReturn CameraStream::on_jpeg(GstPad*, GstPadProbeInfo* info) {
  const MappedBuffer bytes(GST_PAD_PROBE_INFO_BUFFER(info));
  const bool is_whole = jpeg_end(bytes.bytes()).has_value();
  jpegs_have_ends_ = jpegs_have_ends_ || is_whole;
  if (is_whole || !jpegs_have_ends_) return GST_PAD_PROBE_OK;
  ++*chain_.damaged;
  return GST_PAD_PROBE_DROP;
}

// Stores the end of the last coded picture, to find the exact length of a loop. This is done in front of the parser,
// because the file may state the duration of its last picture, but parsers replace this duration by the frame period.
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
  if (const GstClockTime last = segment_begin_; GST_CLOCK_TIME_IS_VALID(last) && begin < last) return GST_PAD_PROBE_OK;
  segment_begin_ = begin;
  segment_end_ = GST_BUFFER_DURATION_IS_VALID(picture) ? begin + GST_BUFFER_DURATION(picture) : GST_CLOCK_TIME_NONE;
  return GST_PAD_PROBE_OK;
}

void CameraStream::record_pending() {
  const std::lock_guard lock(recording_mutex_);
  if (!coded_pad_) return;
  g_autoptr(GstCaps) caps = gst_pad_get_current_caps(coded_pad_);
  for (const PendingCodedFrames::Picture& picture : coded_.take_waiting())
    if (caps) options_.tap(picture.buffer.get(), caps, coded_.in_order(picture.taken, capture_time(picture.taken)));
}

// --- Film position ---------------------------------------------------------------------------------------------------
//
// Seeks, loops, and timestamps for sources without timestamps. The capture time of a film's frame is its position in
// the film, and continues to grow across loops.
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
  if (failed_ || stopping_) return GST_PAD_PROBE_DROP;
  external_seek_pending_ = true;
  if (!options_.seek_to_loop) return GST_PAD_PROBE_OK;
  // Maps a position in a later loop to the start of the film.
  gint64 duration = 0;
  if (gst_pad_peer_query_duration(chain_.decoded, GST_FORMAT_TIME, &duration) && start >= duration) start = 0;
  GstEvent* there = gst_event_new_seek(rate, format, flags, start_type, start, stop_type, stop);
  gst_event_set_seqnum(there, seqnum);
  // Pushes the seek here, with seeking_ locked, because external seeks and the loop's seek must not overlap.
  return gst_pad_push_event(chain_.decoded, there) ? GST_PAD_PROBE_DROP : GST_PAD_PROBE_OK;
}

// A seek after the end of a segment needs no flush. After EOS, which ends a segment that was not started by a seek, a
// flush is required.
void CameraStream::seek_to_start(guint32 seqnum, bool flush) {
  std::lock_guard lock(seeking_);
  if (stopping_ || loop_seqnum_ != seqnum) return;
  const int flags = GST_SEEK_FLAG_SEGMENT | (flush ? GST_SEEK_FLAG_FLUSH : 0);
  GstEvent* seek =
      gst_event_new_seek(1.0, GST_FORMAT_TIME, GstSeekFlags(flags), GST_SEEK_TYPE_SET, 0, GST_SEEK_TYPE_NONE, -1);
  gst_event_set_seqnum(seek, seqnum);
  if (!gst_pad_push_event(chain_.decoded, seek))
    fail(GST_STREAM_ERROR_FAILED,
         "can't loop: the source is not seekable; set loop=false, or use a file that can be "
         "read again from its beginning");
}

// Starts a reopened looping film in its current loop, because decoding all loops since the first would take too long.
// The measured loop duration keeps the film synchronised.
void CameraStream::pass_rounds() {
  gint64 duration = static_cast<gint64>(round_);
  const GstClockTime now = gst_element_get_current_running_time(owner_);
  if (!options_.seek_to_loop || !GST_CLOCK_TIME_IS_VALID(now)) return;
  if (duration == 0) gst_pad_peer_query_duration(chain_.decoded, GST_FORMAT_TIME, &duration);
  if (duration > 0) round_start_ = stream_end_ = now - now % static_cast<guint64>(duration);
}

// Returns the time that is missing at the end of the film, compared with its stated duration. Returns 0 for up to about
// two frames.
GstClockTime CameraStream::missing_at_end() const {
  gint64 duration = 0;
  if (!gst_pad_peer_query_duration(chain_.decoded, GST_FORMAT_TIME, &duration) || duration <= 0) return 0;
  const GstClockTime period = round_frames_ > 0 ? (stream_end_ - round_start_) / round_frames_ : 0;
  const auto said = static_cast<GstClockTime>(duration);
  const bool is_shorter = said > position_ + 2 * period + GST_SECOND / 50;
  return is_shorter && !has_sound(GST_BIN(owner_)) ? said - position_ : 0;
}

// Extends the last frame to the end that the file states, so that the loops of all cameras of a recording have the same
// length.
void CameraStream::finish_loop_segment() {
  segment_begin_ = GST_CLOCK_TIME_NONE;
  const GstClockTime segment_end = segment_end_.exchange(GST_CLOCK_TIME_NONE);
  if (!GST_CLOCK_TIME_IS_VALID(segment_end)) return;
  const GstClockTimeDiff later = GST_CLOCK_DIFF(position_, segment_end);
  stream_end_ = static_cast<GstClockTime>(static_cast<GstClockTimeDiff>(stream_end_) + later);
  film_end_ = static_cast<GstClockTime>(static_cast<GstClockTimeDiff>(film_end_) + later);
  position_ = segment_end;
}

bool CameraStream::begin_again(bool flush) {
  // No loop if no more frames are wanted or the file has no frames.
  if (!options_.seek_to_loop || !is_truncated_ || failed_ || round_frames_ == 0) return false;
  if (stamps_arrival_ || live_latency(chain_.decoded)) return false;

  // If the film was truncated or its last frames were dropped, the rest of the loop stays empty, so that the loops of
  // all cameras stay synchronised.
  finish_loop_segment();
  const GstClockTime missing = missing_at_end();
  const bool dropped = options_.shedder->dropped() != std::exchange(dropped_before_, options_.shedder->dropped());
  if (missing > 0 && !dropped && !std::exchange(cut_off_reported_, true))
    lf_cam_src_warn_truncated(camera_, position_, missing);
  stream_end_ += missing;
  film_end_ += missing;
  if (options_.paced || options_.skips_late) due_ = stream_end_;
  round_ = stream_end_ - round_start_;
  round_start_ = stream_end_;
  film_start_ = film_end_;
  round_frames_ = 0;
  loop_seqnum_ = gst_util_seqnum_next();

  // Seeks in another thread, because a seek waits for this streaming thread.
  call_async(owner_, [stream = shared_from_this(), seqnum = loop_seqnum_.load(), flush] {
    stream->seek_to_start(seqnum, flush);
  });
  return true;
}

// Shifts a segment to the start of this loop (round_start_), so that running time continues.
void CameraStream::delay_segment(GstPadProbeInfo* info) const {
  GstSegment segment = segment_of(info);
  segment.base = round_start_;
  segment.flags = GstSegmentFlags(segment.flags & ~GST_SEGMENT_FLAG_RESET);
  replace_event(info, gst_event_new_segment(&segment));
}

// Replaces byte segments, which elements such as multifilesrc send for JPEG files, by time segments.
void CameraStream::count_time(GstPadProbeInfo* info) {
  counts_time_ = segment_of(info).format != GST_FORMAT_TIME && fps_n_ > 0;
  if (!counts_time_) return;
  GstSegment time;
  gst_segment_init(&time, GST_FORMAT_TIME);
  replace_event(info, gst_event_new_segment(&time));
}

// Fails if the segment has no time format. This happens if decodebin takes data for pictures, but no parser or demuxer
// understands the data.
void CameraStream::check_format(const GstSegment& segment) {
  has_no_time_ = segment.format != GST_FORMAT_TIME;
  if (has_no_time_)
    fail(GST_STREAM_ERROR_FORMAT,
         "the source has bytes without times instead of pictures: check that it is a video in a supported format, or "
         "state a frame rate (framerate=) in the source");
}

// Returns the running time of the element, or 0 before PLAYING, because a first frame may already arrive then.
GstClockTime CameraStream::running_time_now() const {
  const GstClockTime now = gst_element_get_current_running_time(owner_);
  return GST_CLOCK_TIME_IS_VALID(now) ? now : 0;
}

// Stamps a picture without timestamp with its arrival time. Takes and returns a reference.
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
