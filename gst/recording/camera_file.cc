// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/camera_file.h"

#include <gst/video/video.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "base/text.h"
#include "common/common.h"
#include "common/gl_sync.h"
#include "common/guard.h"

namespace lf {
namespace {

// Granularity of timestamps in Matroska. The times of blocks are 16-bit offsets from the start of their cluster, so a
// cluster must be shorter than 0.32 s.
constexpr GstClockTime kTick = 10'000;
constexpr GstClockTime kLongestCluster = 300 * GST_MSECOND;
// The last frame of coded video must be in the same cluster as the previous frame; see CameraFile::end().
constexpr GstClockTime kCodedTick = 20'000, kLongestLastCluster = 650 * GST_MSECOND;
constexpr int kJpegQuality = 95;

const char* name_of(const GstCaps* caps) { return gst_structure_get_name(gst_caps_get_structure(caps, 0)); }

GstCaps* jpeg_caps(int width, int height) {
  return gst_caps_new_simple("image/jpeg", "width", G_TYPE_INT, width, "height", G_TYPE_INT, height, "framerate",
                             GST_TYPE_FRACTION, 0, 1, nullptr);
}

// Returns the caps of raw video without fields that may change from frame to frame, such as the frame rate, because a
// muxer accepts only one caps. The timestamps are in the frames.
GstCaps* picture_caps(const GstCaps* caps) {
  GstCaps* picture = gst_caps_copy(caps);
  gst_caps_set_features_simple(picture, nullptr);  // GPU frames have been downloaded
  gst_structure_remove_field(gst_caps_get_structure(picture, 0), "texture-target");
  gst_caps_set_simple(picture, "framerate", GST_TYPE_FRACTION, 0, 1, "pixel-aspect-ratio", GST_TYPE_FRACTION, 1, 1,
                      nullptr);
  return picture;
}

// Returns only the caps of coded video that a decoder needs. Parsers detect other fields, which may change.
GstCaps* coded_caps(const GstCaps* caps) {
  GstCaps* coded = gst_caps_new_empty_simple(name_of(caps));
  for (const char* field : {"stream-format", "alignment", "codec_data", "width", "height", "profile", "colorimetry",
                            "chroma-site", "pixel-aspect-ratio", "interlace-mode"})
    if (const GValue* value = gst_structure_get_value(gst_caps_get_structure(caps, 0), field))
      gst_caps_set_value(coded, field, value);
  gst_caps_set_simple(coded, "framerate", GST_TYPE_FRACTION, 0, 1, nullptr);
  return coded;
}

GstBuffer* copy_here(GstBuffer* frame, GstCaps* caps) {
  const bool is_on_gpu = gst_buffer_n_memory(frame) > 0 && gst_is_gl_memory(gst_buffer_peek_memory(frame, 0));
  GstVideoInfo info;
  GstVideoFrame from, to;
  if (!is_on_gpu) return gst_buffer_copy_deep(frame);
  wait_for_gl_writer(frame);
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

// Stores the result and does nothing else, because the threads of the bin that call this must not block.
GstBusSyncReply CameraFile::on_message(GstBus* /*bus*/, GstMessage* message, gpointer data) {
  WriterState& outcome = **static_cast<std::shared_ptr<WriterState>*>(data);
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

// Removes durations that parsers have set, because the muxer of GStreamer 1.22 writes pictures with a duration as key
// frames. Drops pictures before the first key frame. The flags of this parser are reliable for that. The parser in
// front of a decoder inserts parameter sets, and therefore marks the first picture as a key frame in any case.
GstPadProbeReturn CameraFile::on_coded(GstPad* /*pad*/, GstPadProbeInfo* info, gpointer data) {
  WriterState& outcome = **static_cast<std::shared_ptr<WriterState>*>(data);
  GstBuffer* picture = gst_buffer_make_writable(GST_PAD_PROBE_INFO_BUFFER(info));
  info->data = picture;
  if (is_key(picture)) outcome.has_key = true;
  if (!outcome.has_key) return GST_PAD_PROBE_DROP;
  const bool is_last = GST_BUFFER_PTS(picture) == outcome.last;
  GST_BUFFER_DURATION(picture) = is_last ? outcome.end - GST_BUFFER_PTS(picture) : GST_CLOCK_TIME_NONE;
  return GST_PAD_PROBE_OK;
}

GstElement* CameraFile::add_parser(GstElement* source) {
  if (!coded_->parser) return source;
  GstElement *parser = add_element(coded_->parser), *form = add_element("capsfilter");
  set_caps(form, gst_caps_from_string(coded_->muxed));
  gst_element_link_many(source, parser, form, nullptr);
  return form;
}

// Starts the file with a text block at time 0. Demuxers subtract the timestamp of the first block, so otherwise the
// cameras would not all count from the start of the recording. The muxer writes nothing at the end if streamable is
// true, but readers miss nothing.
void CameraFile::build(GstCaps* caps, const std::string& begins) {
  kind_ = name_of(caps);
  coded_ = find_coded_video(caps);
  bin_ = GST_ELEMENT(gst_object_ref_sink(gst_bin_new(nullptr)));
  g_autoptr(GstBus) bus =
      GST_BUS(g_object_new(GST_TYPE_BUS, "enable-async", FALSE, nullptr));  // uses no file descriptors
  const GDestroyNotify forget = [](gpointer outcome) { delete static_cast<std::shared_ptr<WriterState>*>(outcome); };
  gst_bus_set_sync_handler(bus, on_message, new std::shared_ptr(writer_state_), forget);
  gst_element_set_bus(bin_, bus);
  GstElement* sink = add_element("filesink");
  g_object_set(sink, "location", path_.c_str(), "sync", FALSE, "async", FALSE, nullptr);
  gst_util_set_object_arg(G_OBJECT(sink), "buffer-mode", "unbuffered");
  GstElement* mux = add_element("matroskamux");
  // Starts a cluster with each key frame, because seeks look for such a cluster.
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
    g_autoptr(GstPad) pad = gst_element_get_static_pad(last, "src");
    gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_BUFFER, on_coded, new std::shared_ptr(writer_state_), forget);
  }
  gst_app_src_push_buffer(GST_APP_SRC(text), text_buffer(begins));
  gst_app_src_end_of_stream(GST_APP_SRC(text));
  source_ = GST_APP_SRC(source);
  // Starts the bin in another thread, because this opens a file. The sources queue data until then.
  gst_element_call_async(
      bin_, [](GstElement* bin, gpointer) { gst_element_set_state(bin, GST_STATE_PLAYING); }, nullptr, nullptr);
}

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

// Coded pictures other than key frames may be out of presentation order.
bool CameraFile::is_no_later(GstBuffer* frame, GstClockTime time) const {
  return !held_.empty() && time <= GST_BUFFER_PTS(held_.front()) && (!coded_ || is_key(frame));
}

CameraFile::AddResult CameraFile::added(GstBuffer* frame, GstCaps* caps, GstClockTime time, const std::string& begins) {
  if (problem()) return AddResult::kFailed;
  if (is_no_later(frame, time)) return AddResult::kNotLater;
  if (!source_ && find_coded_video(caps) && !is_key(frame)) return AddResult::kNoKeyFrame;
  try {
    if (!source_) build(caps, begins);
  } catch (const Error& error) {
    const std::lock_guard lock(writer_state_->mutex);
    writer_state_->error = g_error_new_literal(GST_CORE_ERROR, GST_CORE_ERROR_MISSING_PLUGIN, error.what());
    return AddResult::kFailed;
  }
  if (kind_ != name_of(caps)) return AddResult::kOtherCodec;
  if (coded_ && waits_for_key_ && !is_key(frame)) return AddResult::kNoKeyFrame;
  return has_room(gst_buffer_get_size(frame)) ? AddResult::kTaken : AddResult::kBehind;
}

CameraFile::AddResult CameraFile::add(GstBuffer* frame, GstCaps* caps, GstClockTime time, const std::string& begins) {
  const std::lock_guard lock(mutex_);
  if (ended_) return AddResult::kTaken;
  AddResult added = this->added(frame, caps, time, begins);
  // Copies the frame, because the camera needs to reuse its few buffers.
  GstBuffer* const copy = added == AddResult::kTaken ? copy_here(frame, caps) : nullptr;
  if (added == AddResult::kTaken && !copy) added = AddResult::kBehind;
  waits_for_key_ = added != AddResult::kTaken;
  if (added != AddResult::kTaken) {
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

void CameraFile::note_dropped() {
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
  // Puts the last frame into the cluster of the previous frame. It has a duration and must not start a cluster, because
  // seeks would stop there.
  if (coded_) g_object_set(mux_, "max-cluster-duration", gint64{kLongestLastCluster}, nullptr);
  const GstClockTime until = std::max(time, ends);
  if (coded_ && !held_.empty()) {
    writer_state_->end = until;
    writer_state_->last = GST_BUFFER_PTS(held_.front());
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
  std::unique_lock wait(writer_state_->mutex);
  const auto patience = std::chrono::microseconds(std::max<gint64>(0, deadline - g_get_monotonic_time()));
  writer_state_->changed.wait_for(wait, patience, [=, this] { return writer_state_->done || !started; });
  const bool done = writer_state_->done || !started;
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
  const std::lock_guard lock(writer_state_->mutex);
  const GError* error = writer_state_->error;
  if (!error) return std::nullopt;
  return Problem{path_ + ": " + error->message,
                 g_error_matches(error, GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_NO_SPACE_LEFT) != FALSE};
}

}  // namespace lf
