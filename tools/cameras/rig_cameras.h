// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <gst/gst.h>
#include <nlohmann/json_fwd.hpp>

#include "image/image.h"
#include "image/image_file.h"
#include "rig/rig.h"

namespace lf::cameras {

// Converts a frame of lfcamsrc (raw or JPEG) to RGB. Throws Error if the frame is not readable. Thread-safe.
Image rgb_of(GstBuffer* buffer, GstCaps* caps);
inline Image rgb_of(GstSample* sample) { return rgb_of(gst_sample_get_buffer(sample), gst_sample_get_caps(sample)); }

// Converts a raw frame to grey and reduces its size by the factor `smaller`, averaging square blocks. The size is
// rounded down. Throws Error if the frame is not readable. Thread-safe.
GreyImage small_grey_of(GstSample* sample, int smaller);
bool is_jpeg(GstSample* sample);
std::vector<uint8_t> bytes_of(GstSample* sample);

double brightness_of(const Image& rgb);

// A frame of a camera, passed on the thread that delivers the frame.
struct CameraFrame {
  CameraIndex camera = 0;
  GstSample* sample = nullptr;  // borrowed; RGB in any channel order, I420 or JPEG, at the size in the rig
  double taken = 0;             // capture time, seconds of clock time, including the rig's time offset
  double came = 0;              // arrival time, seconds of the same clock
};

// Runs the cameras of a rig, each through lfcamsrc, under one clock. A camera that fails is reopened and does not
// disturb the other cameras.
class RigCameras {
 public:
  struct Options {
    std::vector<CameraIndex> cameras;
    bool decode = true;
    bool trusted = false;  // allow any element as a source, see rig/source_security.h
    int fps = 0;           // frames per second requested from devices; 0: device default
  };
  using OnFrame = std::function<void(const CameraFrame&)>;

  // `rig` was read from `path`. Throws Error if an element is not installed.
  RigCameras(std::shared_ptr<const Rig> rig, const std::string& path, Options options, OnFrame on_frame);
  ~RigCameras();
  RigCameras(const RigCameras&) = delete;

  void start();
  // Waits this many seconds or until `done` returns true, and collects camera errors meanwhile. Always call it from the
  // same thread.
  void wait(double seconds, const std::function<bool()>& done = {});
  // Stops the cameras. No frame is delivered after stop() returns.
  void stop();

  const std::vector<CameraIndex>& cameras() const { return options_.cameras; }
  double now() const;  // seconds, on the clock of the frames
  uint64_t frames(CameraIndex camera) const;
  std::string problem(CameraIndex camera) const;  // current or latest error of the camera; "": none
  GstStructure* stats(CameraIndex camera) const;  // `stats` of the camera's lfcamsrc; owned by the caller
  // Returns the format of the camera's source: "JPEG", "YUY2", "H264 by RTP". "" before the first frame, and for files
  // and the built-in scene.
  std::string format(CameraIndex camera) const;
  uint64_t source_bytes(CameraIndex camera) const;

 private:
  struct CameraState;
  static void on_child(GstBin* pipeline, GstBin* parent, GstElement* child, gpointer one);
  void read_messages(GstClockTime timeout);

  std::shared_ptr<const Rig> rig_;
  Options options_;
  OnFrame on_frame_;
  GstElement* pipeline_ = nullptr;
  GstClock* clock_ = nullptr;
  std::vector<std::unique_ptr<CameraState>> all_;  // indexed by rig camera; null: camera not opened
};

std::string name_of(const Camera& camera);

// A temporary rig file, deleted by the destructor; lfcamsrc opens cameras through a file. Relative paths are adapted to
// the new location.
class TemporaryRig {
 public:
  // `original`: JSON of the rig file with further fields, such as controls (rig/rig_json.h). `path`: file that the rig
  // was read from. Its sources must be trusted (rig/source_security.h), because the copy always belongs to the current
  // user. Throws Error.
  TemporaryRig(Rig rig, const nlohmann::json& original, const std::string& path, bool trusted);
  ~TemporaryRig();
  TemporaryRig(const TemporaryRig&) = delete;

  std::string path() const { return directory_ + "/rig.json"; }
  std::shared_ptr<const Rig> rig() const { return rig_; }

 private:
  std::string directory_;
  std::shared_ptr<const Rig> rig_;
};

}  // namespace lf::cameras

struct VideoDevice {
  std::string name;
  std::string source;   // value for `source` in a rig: a URI or a launch description
  bool stable = false;  // true: the source identifies the same camera after reboot and replugging
};

// Lists the devices that GstDeviceMonitor finds under Video/Source, from all providers (v4l2, libcamera, Aravis, ...),
// without duplicates, ordered by device number. A V4L2 source is the device's link in `by_path`
// (v4l2:///dev/v4l/by-path/...), or /dev/video0 without such a link, which may change. Other sources are their element
// with the properties that identify the device. Screen capture and devices without an element are skipped. Requires
// gst_init().
std::vector<VideoDevice> find_video_devices(const std::string& by_path = "/dev/v4l/by-path");
