// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/camera_file.h"

#include <gst/video/video.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "base/text.h"
#include "common/common.h"
#include "common/gl_writer.h"
#include "common/guard.h"

namespace lf {
namespace {

// What a stamp of a Matroska block is a multiple of. A block counts from its cluster in 16 bits, so that a cluster has
// to be over before 0.32 s are.
constexpr GstClockTime kTick = 10'000;
constexpr GstClockTime kLongestCluster = 300 * GST_MSECOND;
// Of coded video, whose last frame has to be in the cluster of the one before it, see CameraFile::end().
constexpr GstClockTime kCodedTick = 20'000, kLongestLastCluster = 650 * GST_MSECOND;
constexpr int kJpegQuality = 95;

const char* name_of(const GstCaps* caps) { return gst_structure_get_name(gst_caps_get_structure(caps, 0)); }

GstCaps* jpeg_caps(int width, int height) {
  return gst_caps_new_simple("image/jpeg", "width", G_TYPE_INT, width, "height", G_TYPE_INT, height, "framerate",
                             GST_TYPE_FRACTION, 0, 1, nullptr);
}

// Of raw video: what a frame looks like, and not what may change from frame to frame. Times are in the frames, and a
// muxer takes no other caps than its first ones.
GstCaps* picture_caps(const GstCaps* caps) {
  GstCaps* picture = gst_caps_copy(caps);
  gst_caps_set_features_simple(picture, nullptr);  // what was in a graphics card's memory is here by now
  gst_structure_remove_field(gst_caps_get_structure(picture, 0), "texture-target");
  gst_caps_set_simple(picture, "framerate", GST_TYPE_FRACTION, 0, 1, "pixel-aspect-ratio", GST_TYPE_FRACTION, 1, 1,
                      nullptr);
  return picture;
}

// Of coded video: what a decoder has to know beside the pictures. The rest, which parsers find out, may change.
GstCaps* coded_caps(const GstCaps* caps) {
  GstCaps* coded = gst_caps_new_empty_simple(name_of(caps));
  for (const char* field : {"stream-format", "alignment", "codec_data", "width", "height", "profile", "colorimetry",
                            "chroma-site", "pixel-aspect-ratio", "interlace-mode"})
    if (const GValue* value = gst_structure_get_value(gst_caps_get_structure(caps, 0), field))
      gst_caps_set_value(coded, field, value);
  gst_caps_set_simple(coded, "framerate", GST_TYPE_FRACTION, 0, 1, nullptr);
  return coded;
}

// A copy that is nobody else's, in this process's memory; null where there is none to be had.
GstBuffer* copy_here(GstBuffer* frame, GstCaps* caps) {
  const bool is_on_card = gst_buffer_n_memory(frame) > 0 && gst_is_gl_memory(gst_buffer_peek_memory(frame, 0));
  GstVideoInfo info;
  GstVideoFrame from, to;
  if (!is_on_card) return gst_buffer_copy_deep(frame);
  wait_for_writer(frame);
  if (!gst_video_info_from_caps(&info, caps) || !gst_video_frame_map(&from, &info, frame, GST_MAP_READ)) return nullptr;
  GstBuffer* copy = gst_buffer_new_allocate(nullptr, info.size, nullptr);
  const bool is_there = copy && gst_video_frame_map(&to, &info, copy, GST_MAP_WRITE);
  if (is_there) {
    gst_video_frame_copy(&to, &from);
    gst_video_frame_unmap(&to);
  }
  gst_video_frame_unmap(&from);
  if (!is_there) gst_clear_buffer(&copy);
  return copy;
}

bool is_key(GstBuffer* frame) { return !GST_BUFFER_FLAG_IS_SET(frame, GST_BUFFER_FLAG_DELTA_UNIT); }

void set_caps(GstElement* element, GstCaps* caps) {
  g_object_set(element, "caps", caps, nullptr);
  gst_caps_unref(caps);
}

GstBuffer* text_buffer(const std::string& text) {
  GstBuffer* buffer = gst_buffer_new_allocate(nullptr, text.size(), nullptr);
  gst_buffer_fill(buffer, 0, text.data(), text.size());
  GST_BUFFER_PTS(buffer) = 0;
  GST_BUFFER_DURATION(buffer) = GST_SECOND;
  return buffer;
}

}  // namespace

CameraFile::CameraFile(const Camera& camera, const std::string& path, guint64 most_bytes)
    : width_(camera.width), height_(camera.height), path_(path), most_bytes_(most_bytes) {}

CameraFile::~CameraFile() {
  end(0);
  close(0);
}

// It only takes down what is said, on threads of the bin's, so that nobody waits for it.
GstBusSyncReply CameraFile::on_message(GstBus* /*bus*/, GstMessage* message, gpointer data) {
  Outcome& outcome = **static_cast<std::shared_ptr<Outcome>*>(data);
  const bool is_error = GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR;
  if (is_error || (GST_MESSAGE_TYPE(message) == GST_MESSAGE_EOS && GST_IS_BIN(GST_MESSAGE_SRC(message))))
    guarded(nullptr, false, [&] {
      const std::lock_guard lock(outcome.mutex);
      if (is_error && !outcome.error) gst_message_parse_error(message, &outcome.error, nullptr);
      outcome.done = true;
      outcome.changed.notify_all();
      return true;
    });
  gst_message_unref(message);
  return GST_BUS_DROP;
}

GstElement* CameraFile::add_element(const char* factory) {
  GstElement* element = gst_element_factory_make(factory, nullptr);
  if (!element) throw Error(std::string("element ") + factory + " is not installed");
  gst_bin_add(GST_BIN(bin_), element);
  return element;
}

// Takes the caps. Its bounds are those of has_room().
GstElement* CameraFile::add_source(GstCaps* caps) {
  GstElement* source = add_element("appsrc");
  set_caps(source, caps);
  g_object_set(source, "format", GST_FORMAT_TIME, "max-bytes", guint64{0}, nullptr);
  return source;
}

GstElement* CameraFile::add_jpeg_encoder(GstElement* source) {
  GstElement *convert = add_element("videoconvert"), *format = add_element("capsfilter");
  set_caps(format, gst_caps_from_string("video/x-raw,format=I420,colorimetry=1:4:0:0,chroma-site=jpeg"));
  GstElement* encoder = add_element("jpegenc");
  g_object_set(encoder, "quality", kJpegQuality, nullptr);
  gst_util_set_object_arg(G_OBJECT(encoder), "idct-method", "islow");
  gst_element_link_many(source, convert, format, encoder, nullptr);
  return encoder;
}

// The muxer (GStreamer 1.22) writes what has a duration of its own as if it were a key frame, and parsers give all
// pictures one of theirs, or none.
// The parser before a decoder takes the first picture for a key frame, as it puts parameter sets there; this one knows.
GstPadProbeReturn CameraFile::on_coded(GstPad* /*pad*/, GstPadProbeInfo* info, gpointer data) {
  Outcome& outcome = **static_cast<std::shared_ptr<Outcome>*>(data);
  GstBuffer* picture = gst_buffer_make_writable(GST_PAD_PROBE_INFO_BUFFER(info));
  info->data = picture;
  if (is_key(picture)) outcome.has_key = true;
  if (!outcome.has_key) return GST_PAD_PROBE_DROP;
  const bool is_last = GST_BUFFER_PTS(picture) == outcome.last;
  GST_BUFFER_DURATION(picture) = is_last ? outcome.end - GST_BUFFER_PTS(picture) : GST_CLOCK_TIME_NONE;
  return GST_PAD_PROBE_OK;
}

// Of coded video: what comes before the muxer.
GstElement* CameraFile::add_parser(GstElement* source) {
  if (!coded_->parser) return source;
  GstElement *parser = add_element(coded_->parser), *form = add_element("capsfilter");
  set_caps(form, gst_caps_from_string(coded_->muxed));
  gst_element_link_many(source, parser, form, nullptr);
  return form;
}

// A demuxer counts from the first block on, whatever its stamp is. Here that is the text's, so that all cameras count
// from the beginning of the recording. Streamable: nothing is written at the end that a reader would miss.
void CameraFile::build(GstCaps* caps, const std::string& begins) {
  kind_ = name_of(caps);
  coded_ = find_coded_video(caps);
  bin_ = GST_ELEMENT(gst_object_ref_sink(gst_bin_new(nullptr)));
  GstBus* bus = GST_BUS(g_object_new(GST_TYPE_BUS, "enable-async", FALSE, nullptr));  // it takes no descriptors
  const GDestroyNotify forget = [](gpointer outcome) { delete static_cast<std::shared_ptr<Outcome>*>(outcome); };
  gst_bus_set_sync_handler(bus, on_message, new std::shared_ptr(outcome_), forget);
  gst_element_set_bus(bin_, bus);
  gst_object_unref(bus);
  GstElement* sink = add_element("filesink");
  g_object_set(sink, "location", path_.c_str(), "sync", FALSE, "async", FALSE, nullptr);
  gst_util_set_object_arg(G_OBJECT(sink), "buffer-mode", "unbuffered");
  GstElement* mux = add_element("matroskamux");
  // A seek looks for a cluster that begins with a key frame.
  g_object_set(mux, "streamable", TRUE, "timecodescale", static_cast<gint64>(coded_ ? kCodedTick : kTick),
               "min-cluster-duration", static_cast<gint64>(coded_ ? 0 : kLongestCluster), "max-cluster-duration",
               gint64{kLongestCluster}, nullptr);
  mux_ = mux;
  gst_element_link(mux, sink);
  GstElement* text = add_source(gst_caps_new_simple("text/x-raw", "format", G_TYPE_STRING, "utf8", nullptr));
  gst_element_link_pads(text, "src", mux, "subtitle_%u");
  const bool is_jpeg = kind_ == "image/jpeg";
  GstElement* source = add_source(coded_    ? coded_caps(caps)
                                  : is_jpeg ? jpeg_caps(width_, height_)
                                            : picture_caps(caps));
  GstElement* last = coded_ ? add_parser(source) : is_jpeg ? source : add_jpeg_encoder(source);
  gst_element_link_pads(last, "src", mux, "video_%u");
  if (coded_) {
    GstPad* pad = gst_element_get_static_pad(last, "src");
    gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_BUFFER, on_coded, new std::shared_ptr(outcome_), forget);
    gst_object_unref(pad);
  }
  gst_app_src_push_buffer(GST_APP_SRC(text), text_buffer(begins));
  gst_app_src_end_of_stream(GST_APP_SRC(text));
  source_ = GST_APP_SRC(source);
  // On a thread of its own, as a file is opened; sources take what is pushed before.
  gst_element_call_async(
      bin_, [](GstElement* bin, gpointer) { gst_element_set_state(bin, GST_STATE_PLAYING); }, nullptr, nullptr);
}

// What has not begun has room.
bool CameraFile::has_room(size_t bytes) const {
  constexpr guint64 kLeast = 4;
  return !source_ || gst_app_src_get_current_level_buffers(source_) < kLeast ||
         gst_app_src_get_current_level_bytes(source_) + bytes <= most_bytes_;
}

bool CameraFile::is_behind(size_t bytes) const {
  const std::lock_guard lock(mutex_);
  return !has_room(bytes);
}

void CameraFile::push_held(GstClockTime until) {
  const std::vector<GstBuffer*> frames = std::exchange(held_, {});
  if (!frames.empty()) GST_BUFFER_DURATION(frames.front()) = until - GST_BUFFER_PTS(frames.front());
  for (GstBuffer* frame : frames) gst_app_src_push_buffer(source_, frame);
}

// Coded pictures may be seen in another order, but for key frames.
bool CameraFile::is_no_later(GstBuffer* frame, GstClockTime time) const {
  return !held_.empty() && time <= GST_BUFFER_PTS(held_.front()) && (!coded_ || is_key(frame));
}

CameraFile::Added CameraFile::added(GstBuffer* frame, GstCaps* caps, GstClockTime time, const std::string& begins) {
  if (problem()) return Added::kFailed;
  if (is_no_later(frame, time)) return Added::kNoLater;
  if (!source_ && find_coded_video(caps) && !is_key(frame)) return Added::kNoKey;
  try {
    if (!source_) build(caps, begins);
  } catch (const Error& error) {
    const std::lock_guard lock(outcome_->mutex);
    outcome_->error = g_error_new_literal(GST_CORE_ERROR, GST_CORE_ERROR_MISSING_PLUGIN, error.what());
    return Added::kFailed;
  }
  if (kind_ != name_of(caps)) return Added::kOtherKind;
  if (coded_ && waits_for_key_ && !is_key(frame)) return Added::kNoKey;
  return has_room(gst_buffer_get_size(frame)) ? Added::kTaken : Added::kBehind;
}

CameraFile::Added CameraFile::add(GstBuffer* frame, GstCaps* caps, GstClockTime time, const std::string& begins) {
  const std::lock_guard lock(mutex_);
  if (ended_) return Added::kTaken;
  Added added = this->added(frame, caps, time, begins);
  // A camera's own buffers are few, and it needs them back.
  GstBuffer* const copy = added == Added::kTaken ? copy_here(frame, caps) : nullptr;
  if (added == Added::kTaken && !copy) added = Added::kBehind;
  waits_for_key_ = added != Added::kTaken;
  if (added != Added::kTaken) {
    counts_.dropped++;
    return added;
  }
  if (kind_ != "image/jpeg") {
    g_autoptr(GstCaps) own = coded_ ? coded_caps(caps) : picture_caps(caps);
    gst_app_src_set_caps(source_, own);
  }
  const bool is_newest = held_.empty() || time > GST_BUFFER_PTS(held_.front());
  if (is_newest) {
    if (!held_.empty()) period_ = time - GST_BUFFER_PTS(held_.front());
    push_held(time);
  }
  held_.push_back(copy);
  GST_BUFFER_PTS(copy) = time;
  GST_BUFFER_DTS(copy) = GST_BUFFER_DURATION(copy) = GST_CLOCK_TIME_NONE;
  counts_.frames++;
  return added;
}

void CameraFile::leave_out() {
  const std::lock_guard lock(mutex_);
  waits_for_key_ = true;
  counts_.dropped++;
}

GstClockTime CameraFile::ends_at() const {
  const std::lock_guard lock(mutex_);
  return held_.empty() ? 0 : GST_BUFFER_PTS(held_.front()) + period_;
}

void CameraFile::end(GstClockTime time) {
  const GstClockTime ends = ends_at();
  const std::lock_guard lock(mutex_);
  if (std::exchange(ended_, true) || !source_) return;
  // No seek should begin with the frame that is seen last, for it has a duration.
  if (coded_) g_object_set(mux_, "max-cluster-duration", gint64{kLongestLastCluster}, nullptr);
  const GstClockTime until = std::max(time, ends);
  if (coded_ && !held_.empty()) {
    outcome_->end = until;
    outcome_->last = GST_BUFFER_PTS(held_.front());
  }
  push_held(until);
  gst_app_src_end_of_stream(source_);
}

void CameraFile::close(gint64 deadline) {
  std::unique_lock lock(mutex_);
  GstElement* bin = std::exchange(bin_, nullptr);
  const bool started = source_ != nullptr;
  lock.unlock();
  if (!bin) return;
  std::unique_lock wait(outcome_->mutex);
  const auto patience = std::chrono::microseconds(std::max<gint64>(0, deadline - g_get_monotonic_time()));
  outcome_->changed.wait_for(wait, patience, [=, this] { return outcome_->done || !started; });
  const bool done = outcome_->done || !started;
  wait.unlock();
  const auto stop = [](GstElement* element, gpointer) { gst_element_set_state(element, GST_STATE_NULL); };
  if (done)
    stop(bin, nullptr);
  else
    gst_element_call_async(bin, stop, nullptr, nullptr);
  gst_object_unref(bin);
}

CameraFile::Counts CameraFile::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

std::optional<CameraFile::Problem> CameraFile::problem() const {
  const std::lock_guard lock(outcome_->mutex);
  const GError* error = outcome_->error;
  if (!error) return std::nullopt;
  return Problem{path_ + ": " + error->message,
                 g_error_matches(error, GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_NO_SPACE_LEFT) != FALSE};
}

}  // namespace lf
