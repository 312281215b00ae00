// SPDX-License-Identifier: LGPL-2.1-or-later
#include "mjpeg_writer.h"

#include <cstring>

#include <gst/app/gstappsrc.h>
#include <gst/video/video.h>

#include "base/text.h"
#include "sample_reader.h"

namespace {

// The time code scale sets the resolution of timestamps, here 10 us. The default of 1 ms would shift timestamps by 0.3
// ms on average. Block times are 16-bit offsets from the start of their cluster, so this scale also limits the cluster
// duration (ns).
constexpr char kMuxer[] =
    "matroskamux name=muxer timecodescale=10000 min-cluster-duration=300000000 max-cluster-duration=300000000";

// Describes the colours of Image: full-range BT.601 with chroma in the centre of four pixels.
GstVideoInfo info_of(int width, int height, FrameRate rate) {
  GstVideoInfo info;
  gst_video_info_set_format(&info, GST_VIDEO_FORMAT_I420, width, height);
  info.colorimetry = {GST_VIDEO_COLOR_RANGE_0_255, GST_VIDEO_COLOR_MATRIX_BT601, GST_VIDEO_TRANSFER_UNKNOWN,
                      GST_VIDEO_COLOR_PRIMARIES_UNKNOWN};
  info.chroma_site = GST_VIDEO_CHROMA_SITE_JPEG;
  info.fps_n = rate.numerator;
  info.fps_d = rate.denominator;
  return info;
}

GstBuffer* to_buffer(const lf::Image& i420, const GstVideoInfo& info) {
  GstBuffer* buffer = gst_buffer_new_allocate(nullptr, info.size, nullptr);
  GstVideoFrame frame;
  gst_video_frame_map(&frame, &info, buffer, GST_MAP_WRITE);
  for (int i = 0; i < 3; i++) {
    const size_t width = GST_VIDEO_FRAME_COMP_WIDTH(&frame, i);
    for (int y = 0; y < GST_VIDEO_FRAME_COMP_HEIGHT(&frame, i); y++)
      std::memcpy(static_cast<uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, i)) +
                      static_cast<ptrdiff_t>(y) * GST_VIDEO_FRAME_PLANE_STRIDE(&frame, i),
                  i420.plane(i) + y * width, width);
  }
  gst_video_frame_unmap(&frame);
  return buffer;
}

}  // namespace

MjpegWriter::MjpegWriter(const std::string& path, int width, int height, FrameRate rate, int quality)
    : path_(path), file_(path), rate_(rate) {
  const GstVideoInfo info = info_of(width, height, rate);
  open("jpegenc quality=" + std::to_string(quality) + " ! ", gst_video_info_to_caps(&info));
}

MjpegWriter::MjpegWriter(const std::string& path, int width, int height) : path_(path), file_(path), rate_{0, 1} {
  open("", gst_caps_new_simple("image/jpeg", "width", G_TYPE_INT, width, "height", G_TYPE_INT, height, nullptr));
}

void MjpegWriter::open(const std::string& coder, GstCaps* owned) {
  g_autoptr(GstCaps) caps = owned;
  g_autoptr(GError) error = nullptr;
  pipeline_ = gst_parse_launch(
      ("appsrc name=source format=time block=true max-buffers=4 ! " + coder + kMuxer + " ! fdsink name=sink sync=false")
          .c_str(),
      &error);
  if (error) {
    if (pipeline_) gst_object_unref(pipeline_);
    throw lf::Error(path_ + ": can't be written: " + error->message);
  }
  if (rate_.numerator == 0) write_beginning();
  g_autoptr(GstElement) sink = gst_bin_get_by_name(GST_BIN(pipeline_), "sink");
  source_ = gst_bin_get_by_name(GST_BIN(pipeline_), "source");
  g_object_set(sink, "fd", file_.descriptor(), nullptr);
  gst_app_src_set_caps(GST_APP_SRC(source_), caps);
  if (gst_element_set_state(pipeline_, GST_STATE_PLAYING) == GST_STATE_CHANGE_FAILURE) fail();
}

// Marks time 0 of the film. A demuxer shifts a film so that its first block has time 0, which would shift films of
// cameras with different first frames differently. The first block is therefore a subtitle at time 0. Its text is the
// time of day.
void MjpegWriter::write_beginning() {
  GstElement *text = gst_element_factory_make("appsrc", nullptr),
             *muxer = gst_bin_get_by_name(GST_BIN(pipeline_), "muxer");
  gst_bin_add(GST_BIN(pipeline_), text);
  g_autoptr(GstCaps) caps = gst_caps_new_simple("text/x-raw", "format", G_TYPE_STRING, "utf8", nullptr);
  g_object_set(text, "caps", caps, "format", GST_FORMAT_TIME, nullptr);
  gst_element_link_pads(text, "src", muxer, "subtitle_%u");
  gst_object_unref(muxer);
  g_autoptr(GDateTime) now = g_date_time_new_now_utc();
  gchar* words = g_date_time_format_iso8601(now);
  GstBuffer* buffer = gst_buffer_new_wrapped(words, std::strlen(words));
  GST_BUFFER_PTS(buffer) = 0;
  GST_BUFFER_DURATION(buffer) = GST_SECOND;
  gst_app_src_push_buffer(GST_APP_SRC(text), buffer);
  gst_app_src_end_of_stream(GST_APP_SRC(text));
}

MjpegWriter::~MjpegWriter() { close(); }

void MjpegWriter::close() {
  if (!pipeline_) return;
  gst_element_set_state(pipeline_, GST_STATE_NULL);
  gst_object_unref(source_);
  gst_object_unref(pipeline_);
  pipeline_ = nullptr;
}

void MjpegWriter::add(const lf::Image& rgb, GstClockTime time) {
  GstBuffer* buffer = to_buffer(lf::to_i420(rgb), info_of(rgb.width(), rgb.height(), rate_));
  if (rate_.numerator > 0) GST_BUFFER_DURATION(buffer) = rate_.time(frames_ + 1) - rate_.time(frames_);
  push(buffer, time);
}

void MjpegWriter::add_jpeg(GstBuffer* jpeg, GstClockTime time) {
  GstBuffer* buffer = gst_buffer_copy(jpeg);
  GST_BUFFER_DURATION(buffer) = GST_CLOCK_TIME_NONE;
  push(buffer, time);
}

void MjpegWriter::push(GstBuffer* buffer, GstClockTime time) {
  GST_BUFFER_PTS(buffer) = GST_BUFFER_DTS(buffer) = time;
  frames_++;
  if (gst_app_src_push_buffer(GST_APP_SRC(source_), buffer) != GST_FLOW_OK) fail();
}

void MjpegWriter::finish() {
  gst_app_src_end_of_stream(GST_APP_SRC(source_));
  g_autoptr(GstBus) bus = gst_element_get_bus(pipeline_);
  g_autoptr(GstMessage) message = gst_bus_timed_pop_filtered(
      bus, GST_CLOCK_TIME_NONE, static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR));
  const bool whole = GST_MESSAGE_TYPE(message) == GST_MESSAGE_EOS;
  if (!whole) gst_bus_post(bus, gst_message_ref(message));
  if (!whole) fail();
  close();
  file_.commit();
}

void MjpegWriter::fail() {
  // Another thread may still be posting the error.
  const std::string reason = lf::bus_error(pipeline_, GST_SECOND, "the pipeline stopped");
  close();  // the destructor does not run after an error in the constructor
  throw lf::Error(path_ + ": can't be written: " + reason);
}
