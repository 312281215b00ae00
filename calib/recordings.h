// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "calibration/moving_light.h"
#include "calibration/tracks.h"
#include "image/image.h"
#include "rig/rig.h"

// Finds and reads the recordings of a rig's cameras. A recording in a folder is a file NAME.*, where NAME is the name
// of the camera. Recorders often leave thumbnails, time codes, subtitles and audio beside a video, so the content of a
// file decides its type, not the extension. A file with several JPEG images is a video. All functions require
// gst_init().

// Returns the path of a camera's video in `folder`. If `folder` is empty, returns the file that the rig names as the
// camera's source. Throws lf::Error unless there is exactly one video.
std::string find_recording(const std::string& folder, const lf::Rig& rig, const lf::Camera& camera);

// Returns a copy of `rig` with the videos in `folder` as sources and the stills as images. Other sources and images are
// removed. Throws lf::Error if a camera has two videos, or two stills and no video.
lf::Rig with_recordings(const std::string& folder, lf::Rig rig);

// Returns the images that show a camera's view of the calibration board: all stills in the subfolder NAME of `folder`,
// in natural order. Without this subfolder, returns the URI of the video NAME.*, or nothing if there is none. Throws
// lf::Error if there are two videos.
std::vector<std::string> board_images(const std::string& folder, const lf::Camera& camera);

// Returns the cameras of a folder with board images: the names of all subfolders that contain stills and of all videos,
// in natural order.
std::vector<std::string> board_cameras(const std::string& folder);

// Throws lf::Error if `folder` is given but is not a folder.
void check_folder(const std::string& folder);

enum class VideoFormat { kGrey, kRgb };

// A decoded video frame. A pixel is one byte of luma, or three bytes of R, G and B.
struct VideoFrame {
  const uint8_t* samples;  // valid only during the callback
  ptrdiff_t stride;        // bytes per row
  int width, height;
  double time;      // stream time, seconds
  double progress;  // fraction of the video up to this frame, 0 to 1; 0 if the duration is unknown

  lf::Image rgb() const;  // a copy of a frame in kRgb
};

// Decodes a file or a GStreamer URI and calls `use` for each frame, until `use` returns false or the video ends. Frames
// before a decoding error are usable, so an error after the first frame counts as the end of the video. Throws
// lf::Error if there is no video.
void for_each_video_frame(const std::string& path_or_uri, VideoFormat format,
                          const std::function<bool(const VideoFrame&)>& use);

// The GStreamer elements that deliver a video, and its name for messages.
struct VideoSource {
  std::string elements, name;
  bool waits = true;  // true if the source can wait; otherwise frames that arrive during processing are dropped
};
// Does the same with RGB frames of other sources.
void for_each_video_frame(const VideoSource& source, const std::function<bool(const VideoFrame&)>& use);

// Returns the duration of a video in seconds. Returns 0 if it is unknown, for example for a live source.
double video_duration(const std::string& path_or_uri);

// Calls `read` for each of `count` recordings, `threads` at a time, and shows a progress bar with the label `what`.
// `read` passes the completed fraction of its recording, 0 to 1, to its second argument. If it throws, no further
// recordings are read, and the exception is rethrown.
void for_each_recording(const std::string& what, size_t count, int threads,
                        const std::function<void(size_t, const std::function<void(double)>&)>& read);

// The lights that were detected in the recordings of all cameras of a rig, with the reasons why recordings are
// unusable.
struct LightRecordings {
  struct Camera {
    lf::LightDetectorStats record;
    lf::LightSummary summary;
    std::string trouble;  // why the recording is unusable, with the remedy; empty if it is usable
  };
  lf::LightDetections sights;
  std::vector<Camera> cameras;
  std::vector<lf::Finding> findings;

  size_t useful() const;
  // Returns one line per unusable recording, for a message to the user, such as "camera 3 (cam_00_03) is black from
  // ...".
  std::vector<std::string> troubles(const lf::Rig& rig) const;
};

// Detects lights in the recordings in `folder` (see find_recording()) and shows a progress bar. Processes `threads`
// recordings at a time. Unusable recordings are reported in the result. Throws lf::Error only if the folder does not
// exist.
LightRecordings detect_lights(const lf::Rig& rig, const std::string& folder, bool bar, int threads);
