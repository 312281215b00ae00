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

// Converts a raw or JPEG frame of lfcamsrc to RGB. Throws Error if the frame is unreadable. Thread-safe.
Image rgb_of(GstBuffer* buffer, GstCaps* caps);
inline Image rgb_of(GstSample* sample) { return rgb_of(gst_sample_get_buffer(sample), gst_sample_get_caps(sample)); }

// Converts a raw frame to a smaller grey image by averaging blocks of `smaller` x `smaller` pixels; the size is rounded
// down. Throws Error if the frame is unreadable. Thread-safe.
GreyImage small_grey_of(GstSample* sample, int smaller);
bool is_jpeg(GstSample* sample);
std::vector<uint8_t> bytes_of(GstSample* sample);

double brightness_of(const Image& rgb);

// A frame of a camera, as it is passed to the program on the delivering thread.
struct CameraFrame {
  CameraIndex camera = 0;
  GstSample* sample = nullptr;  // borrowed; RGB in any channel order, I420 or JPEG, in the image size of the rig
  double taken = 0;             // capture time on the common clock, including the rig's time offset, seconds
  double arrival_time = 0;      // on the same clock, seconds
};

// Opens and runs the cameras of a rig together, each through its own lfcamsrc, on one common clock. A camera that fails
// is reopened and does not disturb other cameras.
class RigCameras {
 public:
  struct Options {
    std::vector<CameraIndex> cameras;
    bool decode = true;
    bool trusted = false;  // allow any element as a camera source, see rig/source_security.h
    int fps = 0;           // frame rate requested from devices; 0: the device decides
  };
  using OnFrame = std::function<void(const CameraFrame&)>;

  // `path` is the file of `rig`. Throws Error if an element is not installed.
  RigCameras(std::shared_ptr<const Rig> rig, const std::string& path, Options options, OnFrame on_frame);
  ~RigCameras();
  RigCameras(const RigCameras&) = delete;

  void start();
  // Waits this many seconds, or until `done` returns true. Errors of cameras are collected only during a wait, so wait
  // while the cameras run. All waits must be on the same thread.
  void wait(double seconds, const std::function<bool()>& done = {});
  // Waits until all cameras have delivered a frame or have failed, but at most for this many seconds.
  void wait_for_frames(double seconds);
  // Stops the cameras. After stop() has returned, no frame is delivered any more.
  void stop();

  const std::vector<CameraIndex>& cameras() const { return options_.cameras; }
  double now() const;  // seconds, on the clock of the frames
  uint64_t frames(CameraIndex camera) const;
  bool is_settled(CameraIndex camera) const { return frames(camera) > 0 || !problem(camera).empty(); }
  std::string problem(CameraIndex camera) const;  // latest error of the camera; empty if there is none
  GstStructure* stats(CameraIndex camera) const;  // owned by the caller
  // Returns the format that the camera delivers, such as "JPEG", "YUY2" or "H264 by RTP". Returns an empty text before
  // the first frame, and for files and the built-in scene.
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
  std::vector<std::unique_ptr<CameraState>> all_;  // null for cameras that are not opened
};

std::string name_of(const Camera& camera);

// A temporary copy of a changed rig, as a file that lfcamsrc can open. Relative paths are adapted to the new location.
// The destructor deletes the file.
class TemporaryRig {
 public:
  // `original` is the JSON of the rig file with all fields, such as controls (rig/rig_json.h); `path` is the file. The
  // copy belongs to the current user, which would make all its sources trusted. The constructor therefore throws Error
  // if the sources of the original are not trusted (rig/source_security.h).
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
  std::string source;   // value of `source` in a rig file: a URI or a launch description
  bool stable = false;  // true if the source denotes the same camera after a reboot or replugging
};

// Lists the cameras that GstDeviceMonitor finds (Video/Source) with all providers (v4l2, libcamera, Aravis, ...). Each
// device appears once, in the order of the device numbers. Screen captures and devices without an element are skipped.
//
// A V4L2 source is the link of the device in `by_path` (v4l2:///dev/v4l/by-path/...). Without such a link, the source
// is a name like /dev/video0, which may change. Other sources are a launch description of the device's element with the
// properties that identify the device. Requires gst_init().
std::vector<VideoDevice> find_video_devices(const std::string& by_path = "/dev/v4l/by-path");
