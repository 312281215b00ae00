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

// Recordings in a folder are files NAME.*, with the name of the camera. The file type is determined from the content,
// not from the extension, because recorders leave thumbnails, time codes, subtitles and audio beside videos. A file
// with several JPEG images is a video. All functions require gst_init().

// Returns the path of a camera's video in `folder`, or the rig's source file if `folder` is empty. Throws lf::Error if
// there is no video, or more than one.
std::string find_recording(const std::string& folder, const lf::Rig& rig, const lf::Camera& camera);

// Returns `rig` with the videos in `folder` as sources and the stills as images; other sources and images are removed.
// Throws lf::Error if a camera has two videos, or two stills and no video.
lf::Rig with_recordings(const std::string& folder, lf::Rig rig);

// Returns a camera's images of a board: all stills in the subfolder NAME of `folder`, in natural order. Without that
// subfolder, returns the URI of the video NAME.*, or nothing. Throws lf::Error if there are two videos.
std::vector<std::string> board_images(const std::string& folder, const lf::Camera& camera);

// Throws lf::Error if `folder` is neither empty nor a folder.
void check_folder(const std::string& folder);

enum class VideoFormat { kGrey, kRgb };

// A video frame: 8 bits of luma, or of R, G and B, per pixel.
struct VideoFrame {
  const uint8_t* samples;  // valid during the callback
  ptrdiff_t stride;        // bytes per row
  int width, height;
  double time;      // stream time, seconds
  double progress;  // played share of the video; 0 if the duration is unknown
};

// Calls `use` for all frames of a file or GStreamer URI, until it returns false or the video ends. An error after the
// first frame counts as the end. Throws lf::Error if there is no video.
void for_each_video_frame(const std::string& path_or_uri, VideoFormat format,
                          const std::function<bool(const VideoFrame&)>& use);

// Returns the duration in seconds, or 0 if it is unknown (live sources, no video).
double video_duration(const std::string& path_or_uri);

// Detected lights in the recordings of a rig's cameras.
struct LightRecordings {
  struct Camera {
    lf::LightDetectorStats record;
    lf::LightSummary summary;
    std::string trouble;  // why the recording is unusable, and the remedy; "": usable
  };
  lf::LightDetections sights;
  std::vector<Camera> cameras;
  std::vector<lf::Finding> findings;  // about all recordings together

  size_t useful() const;
  // Returns for example "camera 3 (cam_00_03) is black from ...", for each unusable recording.
  std::vector<std::string> troubles(const lf::Rig& rig) const;
};

// Detects lights in the recordings in `folder` (see find_recording()), `threads` at a time, with a progress bar. Throws
// lf::Error if the folder does not exist. Unusable recordings are reported in `cameras`.
LightRecordings detect_lights(const lf::Rig& rig, const std::string& folder, bool bar, int threads);
