// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "calibration/moving_light.h"
#include "calibration/tracks.h"
#include "rig/rig.h"

// Recordings of a folder are files NAME.*, NAME being the camera's. Their content decides what they are, not the ending
// of their names: cameras and recorders leave thumbnails, time codes, subtitles and sound beside their films. A file of
// several JPEG pictures is a film. gst_init() must have been called.

// The path of a camera's film in `folder` or, where that is empty, the file that is its source in the rig. Throws
// lf::Error that says what to do where there is none, or two.
std::string recording_of(const std::string& folder, const lf::Rig& rig, const lf::Camera& camera);

// `rig` with the films in `folder` as sources and the stills as images. A camera without one has neither. Throws
// lf::Error where a camera has two films, or no film and two stills.
lf::Rig recorded_in(const std::string& folder, lf::Rig rig);

// The pictures of a board that a camera took: all stills in the folder NAME of `folder`, in natural order, or else the
// URI of the film NAME.* as the only element, or nothing. Throws lf::Error where there are two films.
std::vector<std::string> boards_in(const std::string& folder, const lf::Camera& camera);

// Throws lf::Error where `folder` is not empty and no folder.
void check_folder(const std::string& folder);

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

// What recordings of a moving light show, of each camera of a rig.
struct LightRecordings {
  struct Camera {
    lf::LightRecord record;
    lf::LightSummary summary;
    std::string trouble;  // why the recording is of no use, and what to do about it; "": it is of use
  };
  lf::LightSights sights;
  std::vector<Camera> cameras;
  std::vector<lf::Finding> findings;  // findings about all recordings together

  size_t useful() const;
  // "camera 3 (cam_00_03) is black from ...", of each that is of no use.
  std::vector<std::string> troubles(const lf::Rig& rig) const;
};

// Looks through the recordings in `folder` (recording_of()), `threads` at a time, with a progress bar. gst_init() must
// have been called. Throws lf::Error where there is no such folder; recordings that are of no use are said in
// `cameras`.
LightRecordings watch_lights(const lf::Rig& rig, const std::string& folder, bool bar, int threads);
