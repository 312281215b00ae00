// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/app/gstappsink.h>
#include <gst/gst.h>

#include <string>
#include <vector>

#include "gst/gst_test.h"

namespace lf::test {

// The times, in the file, of the video frames of a Matroska file, and where the last one ends.
struct RecordedFile {
  std::vector<GstClockTime> times;
  GstClockTime end = 0;
};

inline RecordedFile read_recorded(const std::string& path) {
  RecordedFile file;
  const ElementPtr pipeline =
      launch("filesrc location=" + path + " ! matroskademux name=d d.video_0 ! appsink name=s sync=false");
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr sink(gst_bin_get_by_name(GST_BIN(pipeline.get()), "s"));
  while (GstSample* sample = gst_app_sink_try_pull_sample(GST_APP_SINK(sink.get()), 10 * GST_SECOND)) {
    GstBuffer* frame = gst_sample_get_buffer(sample);
    file.times.push_back(
        gst_segment_to_stream_time(gst_sample_get_segment(sample), GST_FORMAT_TIME, GST_BUFFER_PTS(frame)));
    if (GST_BUFFER_DURATION_IS_VALID(frame)) file.end = file.times.back() + GST_BUFFER_DURATION(frame);
    gst_sample_unref(sample);
  }
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  return file;
}

}  // namespace lf::test
