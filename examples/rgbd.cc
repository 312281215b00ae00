// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Uses a light field as a depth camera for OpenCV. The program receives pictures with the depth of each pixel, and
// writes the last picture beside its depths to rgbd.png. Near objects are red, and pixels with uncertain depths black.
//
//   g++ -std=c++20 -isystem /usr/include/opencv4 rgbd.cc $(pkg-config --cflags --libs gstreamer-app-1.0
//     gstreamer-video-1.0) -lopencv_core -lopencv_imgproc -lopencv_imgcodecs -o rgbd && ./rgbd rig.json
#include <gst/app/gstappsink.h>
#include <gst/gst.h>
#include <gst/video/video.h>

#include <cstdio>
#include <cstdlib>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace {

// Returns a copy of the pixels of a sample. `type` is the OpenCV type of a pixel, such as CV_8UC3.
cv::Mat pixels_of(GstSample* sample, int type) {
  GstVideoInfo info;
  GstVideoFrame frame;
  if (!gst_video_info_from_caps(&info, gst_sample_get_caps(sample)) ||
      !gst_video_frame_map(&frame, &info, gst_sample_get_buffer(sample), GST_MAP_READ))
    return {};
  const cv::Mat pixels = cv::Mat(info.height, info.width, type, GST_VIDEO_FRAME_PLANE_DATA(&frame, 0),
                                 static_cast<size_t>(GST_VIDEO_FRAME_PLANE_STRIDE(&frame, 0)))
                             .clone();
  gst_video_frame_unmap(&frame);
  return pixels;
}

// Returns the depths in metres along the optical axis: NaN where the depth is unknown, and infinity is possible.
cv::Mat depths_of(GstSample* sample) {
  const GstStructure* caps = gst_caps_get_structure(gst_sample_get_caps(sample), 0);
  double scale = 0, offset = 0;
  gst_structure_get(caps, "depth-scale", G_TYPE_DOUBLE, &scale, "depth-offset", G_TYPE_DOUBLE, &offset, nullptr);
  const cv::Mat values = pixels_of(sample, CV_16UC1);
  cv::Mat inverse, depths;
  values.convertTo(inverse, CV_32F, scale, offset);
  cv::divide(1.0, inverse, depths);
  depths.setTo(NAN, values == 0);
  return depths;
}

// Takes samples from a sink until one has this time. Returns null at the end of the stream.
GstSample* sample_at(GstElement* sink, GstClockTime time) {
  GstSample* sample = nullptr;
  while ((sample = gst_app_sink_try_pull_sample(GST_APP_SINK(sink), 10 * GST_SECOND)) &&
         GST_BUFFER_PTS(gst_sample_get_buffer(sample)) < time)
    gst_sample_unref(sample);
  return sample;
}

}  // namespace

int main(int argc, char** argv) {
  gst_init(&argc, &argv);
  if (argc < 2) {
    std::fprintf(stderr, "usage: rgbd RIG.json [PICTURES]\n");
    return 1;
  }
  const int pictures = argc > 2 ? std::atoi(argv[2]) : 30;
  GError* error = nullptr;
  GstElement* pipeline = gst_parse_launch(
      "lfviewsrc name=v width=320 height=240 framerate=15/1 "
      "v.src ! videoconvert ! video/x-raw,format=BGR ! appsink name=colour max-buffers=8 drop=true "
      "v.depth_src ! appsink name=depth max-buffers=8 drop=true "
      "v.confidence_src ! appsink name=confidence max-buffers=8 drop=true",
      &error);
  if (error) {
    std::fprintf(stderr, "%s\n", error->message);
    g_error_free(error);
    return 1;
  }
  GstElement* light_field = gst_bin_get_by_name(GST_BIN(pipeline), "v");
  g_object_set(light_field, "rig", argv[1], nullptr);
  GstElement* sinks[3];
  const char* const names[] = {"colour", "depth", "confidence"};
  for (int i = 0; i < 3; i++) sinks[i] = gst_bin_get_by_name(GST_BIN(pipeline), names[i]);
  gst_element_set_state(pipeline, GST_STATE_PLAYING);

  int shown = 0;
  while (shown < pictures) {
    // The three pictures of one instant have the same time. A slow program loses some of them.
    GstSample* samples[3] = {sample_at(sinks[0], 0)};
    if (!samples[0]) break;
    const GstClockTime time = GST_BUFFER_PTS(gst_sample_get_buffer(samples[0]));
    bool is_complete = true;
    for (int i = 1; i < 3; i++) {
      samples[i] = sample_at(sinks[i], time);
      is_complete &= samples[i] && GST_BUFFER_PTS(gst_sample_get_buffer(samples[i])) == time;
    }
    if (is_complete) {
      const cv::Mat colour = pixels_of(samples[0], CV_8UC3), depths = depths_of(samples[1]);
      const cv::Mat is_certain = pixels_of(samples[2], CV_8UC1) > 127;
      double nearest = 0;
      cv::minMaxLoc(depths, &nearest, nullptr, nullptr, nullptr, is_certain);
      std::printf("picture %d: %d certain depths, the nearest at %.3f m\n", shown, cv::countNonZero(is_certain),
                  nearest);
      if (++shown == pictures) {
        cv::Mat grey, false_colours, both;
        cv::Mat(255 * nearest / depths).convertTo(grey, CV_8U);
        cv::applyColorMap(grey, false_colours, cv::COLORMAP_JET);
        false_colours.setTo(0, ~is_certain);
        cv::hconcat(colour, false_colours, both);
        cv::imwrite("rgbd.png", both);
      }
    }
    for (GstSample* sample : samples)
      if (sample) gst_sample_unref(sample);
  }
  gst_element_set_state(pipeline, GST_STATE_NULL);
  for (GstElement* sink : sinks) gst_object_unref(sink);
  gst_object_unref(light_field);
  gst_object_unref(pipeline);
  return shown == pictures ? 0 : 1;
}
