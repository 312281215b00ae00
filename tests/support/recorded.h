// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/app/gstappsink.h>

#include "gst/gst_test.h"

namespace lf::test {

struct RecordedFile {
  std::shared_ptr<GstCaps> caps;
  std::string kind;  // the name of the caps
  std::vector<GstClockTime> times;
  std::vector<bool> keys;
  std::vector<std::vector<uint8_t>> frames;
  GstClockTime end = 0;
};

inline RecordedFile read_recorded(const std::string& path) {
  RecordedFile file;
  const PipelinePtr pipeline =
      launch("filesrc location=" + path + " ! matroskademux name=d d.video_0 ! appsink name=s sync=false");
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr sink = child_of(pipeline.get(), "s");
  while (g_autoptr(GstSample) sample = gst_app_sink_try_pull_sample(GST_APP_SINK(sink.get()), 10 * GST_SECOND)) {
    GstBuffer* frame = gst_sample_get_buffer(sample);
    file.times.push_back(
        gst_segment_to_stream_time(gst_sample_get_segment(sample), GST_FORMAT_TIME, GST_BUFFER_PTS(frame)));
    if (GST_BUFFER_DURATION_IS_VALID(frame))
      file.end = std::max(file.end, file.times.back() + GST_BUFFER_DURATION(frame));
    file.caps.reset(gst_caps_ref(gst_sample_get_caps(sample)), gst_caps_unref);
    file.kind = gst_structure_get_name(gst_caps_get_structure(file.caps.get(), 0));
    file.keys.push_back(!GST_BUFFER_FLAG_IS_SET(frame, GST_BUFFER_FLAG_DELTA_UNIT));
    file.frames.push_back(to_bytes(frame));
  }
  return file;
}

// Returns the coded slices of each frame of an H.264 file, without metadata.
inline std::vector<std::vector<uint8_t>> slices_of(const RecordedFile& file) {
  std::vector<std::vector<uint8_t>> all;
  for (const std::vector<uint8_t>& frame : file.frames) {
    std::vector<uint8_t>& slices = all.emplace_back();
    for (size_t at = 0; at + 5 <= frame.size();) {
      size_t size = 0;
      for (int i = 0; i < 4; i++) size = size << 8 | frame[at++];
      const int type = frame[at] & 31;
      const auto begin = frame.begin() + static_cast<ptrdiff_t>(at);
      size = std::min(size, frame.size() - at);
      if (type == 1 || type == 5) slices.insert(slices.end(), begin, begin + static_cast<ptrdiff_t>(size));
      at += size;
    }
  }
  return all;
}

}  // namespace lf::test
