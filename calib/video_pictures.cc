// SPDX-License-Identifier: LGPL-2.1-or-later
#include "video_pictures.h"

#include <gst/app/gstappsink.h>
#include <gst/video/video.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <system_error>

#include "base/error.h"
#include "posted_error.h"
#include "rig/rig.h"

namespace {

using Element = std::unique_ptr<GstElement, decltype(&gst_object_unref)>;

// What went wrong, of the pipeline's own messages.
std::string reason_of(GstElement* pipeline) { return lf::posted_error(pipeline, 0, "no video could be had from it"); }

// jpegdec is quick by default, at the cost of errors that show in places of a hundredth of a pixel.
void decode_exactly(GstBin*, GstBin*, GstElement* element, gpointer) {
  if (g_object_class_find_property(G_OBJECT_GET_CLASS(element), "idct-method"))
    gst_util_set_object_arg(G_OBJECT(element), "idct-method", "islow");
}

class Pipeline {
 public:
  Pipeline(const std::string& place, VideoFormat format) : place_(place) {
    std::error_code ignored;
    if (std::filesystem::exists(place, ignored) && !std::filesystem::is_regular_file(place, ignored))
      throw lf::Error(place + ": is not a regular file");
    GError* error = nullptr;
    gchar* uri = lf::is_uri(place) ? g_strdup(place.c_str()) : gst_filename_to_uri(place.c_str(), nullptr);
    GstElement* made = gst_parse_launch(
        (std::string("uridecodebin name=source ! videoconvert ! videoflip video-direction=auto ! videoconvert ! ") +
         "video/x-raw,format=" + (format == VideoFormat::kGrey ? "GRAY8" : "RGB") +
         " ! appsink name=sink sync=false max-buffers=4")
            .c_str(),
        &error);
    if (error || !uri) {
      const std::string reason = error ? error->message : "is no path";
      g_clear_error(&error);
      g_free(uri);
      if (made) gst_object_unref(made);
      throw lf::Error(place + ": " + reason);
    }
    pipeline_.reset(made);
    const Element source(gst_bin_get_by_name(GST_BIN(made), "source"), gst_object_unref);
    g_object_set(source.get(), "uri", uri, nullptr);
    g_signal_connect(source.get(), "deep-element-added", G_CALLBACK(decode_exactly), nullptr);
    g_free(uri);
    sink_.reset(gst_bin_get_by_name(GST_BIN(made), "sink"));
    if (gst_element_set_state(made, GST_STATE_PLAYING) == GST_STATE_CHANGE_FAILURE)
      throw lf::Error(place + ": " + reason_of(made));
  }
  ~Pipeline() {
    if (pipeline_) gst_element_set_state(pipeline_.get(), GST_STATE_NULL);
  }

  // False at the end. An error ends a stream, too: what came before it is good.
  bool next(const std::function<bool(const VideoPicture&)>& use) {
    GstSample* sample = nullptr;
    while (!sample) {
      sample = gst_app_sink_try_pull_sample(GST_APP_SINK(sink_.get()), 100 * GST_MSECOND);
      if (sample) break;
      if (gst_app_sink_is_eos(GST_APP_SINK(sink_.get()))) return ended();
      GstBus* bus = gst_element_get_bus(pipeline_.get());
      GstMessage* message = gst_bus_pop_filtered(bus, GST_MESSAGE_ERROR);
      if (message) gst_bus_post(bus, message);  // for reason_of()
      gst_object_unref(bus);
      if (message) return ended();
    }
    const std::unique_ptr<GstSample, decltype(&gst_sample_unref)> owner(sample, gst_sample_unref);
    GstVideoInfo info;
    GstVideoFrame frame;
    GstBuffer* buffer = gst_sample_get_buffer(sample);
    if (!gst_video_info_from_caps(&info, gst_sample_get_caps(sample)) ||
        !gst_video_frame_map(&frame, &info, buffer, GST_MAP_READ))
      throw lf::Error(place_ + ": a picture can't be read");
    const GstClockTime time =
        gst_segment_to_stream_time(gst_sample_get_segment(sample), GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
    bool more = true;
    if (GST_CLOCK_TIME_IS_VALID(time)) {
      const double seconds = static_cast<double>(time) / GST_SECOND, all = length();
      any_ = true;
      more = use({static_cast<const uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, 0)),
                  GST_VIDEO_FRAME_PLANE_STRIDE(&frame, 0), info.width, info.height, seconds,
                  all > 0 ? std::min(1.0, seconds / all) : 0});
    }
    gst_video_frame_unmap(&frame);
    return more;
  }

  double length() const {
    gint64 length = 0;
    return gst_element_query_duration(pipeline_.get(), GST_FORMAT_TIME, &length) && length > 0
               ? static_cast<double>(length) / GST_SECOND
               : 0;
  }

 private:
  bool ended() {
    if (!any_) throw lf::Error(place_ + ": " + reason_of(pipeline_.get()));
    return false;
  }

  const std::string place_;
  Element pipeline_{nullptr, gst_object_unref}, sink_{nullptr, gst_object_unref};
  bool any_ = false;
};

}  // namespace

void for_each_picture(const std::string& path_or_uri, VideoFormat format,
                      const std::function<bool(const VideoPicture&)>& use) {
  Pipeline pipeline(path_or_uri, format);
  while (pipeline.next(use)) {
  }
}

double length_of_video(const std::string& path_or_uri) {
  try {
    Pipeline pipeline(path_or_uri, VideoFormat::kGrey);
    double length = 0;
    // It is known once the first picture is there.
    pipeline.next([&](const VideoPicture&) {
      length = pipeline.length();
      return false;
    });
    return length;
  } catch (const lf::Error&) {
    return 0;
  }
}
