// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

enum class VideoFormat { kGrey, kRgb };

// A picture of a video: 8 bits of brightness a pixel, or of R, G and B.
struct VideoPicture {
  const uint8_t* samples;  // valid until the next picture
  ptrdiff_t stride;        // bytes from row to row
  int width, height;
  double time;      // stamp of the picture in the video, seconds
  double progress;  // share of the video that has passed, as far as its length is known; else 0
};

// Hands all pictures of a file or GStreamer URI to `use` until that returns false or the video ends. gst_init() must
// have been called. Throws lf::Error where there is no video; one that breaks off has ended.
void for_each_picture(const std::string& path_or_uri, VideoFormat format,
                      const std::function<bool(const VideoPicture&)>& use);

// Seconds; 0 where it is not known: of what is live, or no video at all.
double length_of_video(const std::string& path_or_uri);
