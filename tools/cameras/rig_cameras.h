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

// The picture of a frame of lfcamsrc, raw or JPEG, as RGB. Throws Error for what can't be read. Any thread.
Image rgb_of(GstBuffer* buffer, GstCaps* caps);
inline Image rgb_of(GstSample* sample) { return rgb_of(gst_sample_get_buffer(sample), gst_sample_get_caps(sample)); }

// A raw frame in grey, `smaller` times as narrow and as low: the mean of so many pixels in a square, rounded down where
// there are fewer. Throws Error for what can't be read. Any thread.
GreyPicture small_grey_of(GstSample* sample, int smaller);
bool is_jpeg(GstSample* sample);
std::vector<uint8_t> bytes_of(GstSample* sample);

// Mean brightness, 0..255, of a picture that is RGB.
double brightness_of(const Image& rgb);

// A frame of a camera, in the thread that brings it.
struct CameraFrame {
  CameraIndex camera = 0;
  GstSample* sample = nullptr;  // borrowed; RGB of any order, I420 or JPEG, of the size in the rig
  double taken = 0;             // seconds of clock time; capture time as the light field takes it
  double came = 0;              // when the frame was here, seconds of the same clock
};

// The cameras of a rig, each opened as the light field opens it (lfcamsrc), side by side under one clock. One that
// fails leaves the others alone, and is opened again.
class RigCameras {
 public:
  struct Options {
    std::vector<CameraIndex> cameras;  // indices of the cameras to open; empty: all
    bool decode = true;                // JPEG is decoded; else it comes as it is
    bool trusted = false;              // the rig may run any element, see rig/source_security.h
    int fps = 0;                       // asked of devices, frames per second; 0: as they have it
  };
  using OnFrame = std::function<void(const CameraFrame&)>;

  // `rig` has been read from `path`. Throws Error where an element is not installed.
  RigCameras(std::shared_ptr<const Rig> rig, const std::string& path, Options options, OnFrame on_frame);
  ~RigCameras();
  RigCameras(const RigCameras&) = delete;

  // Starts the cameras and does not wait for them.
  void start();
  // Waits for so many seconds, or until `done` is true. To be called from one thread; what has failed is known
  // afterwards.
  void wait(double seconds, const std::function<bool()>& done = {});
  // Stops the cameras: no frame comes any more.
  void stop();

  const std::vector<CameraIndex>& cameras() const { return options_.cameras; }
  double now() const;                             // seconds, by the clock of the frames
  uint64_t frames(CameraIndex camera) const;      // frames of the camera that have come
  std::string problem(CameraIndex camera) const;  // why it does not work, or did not for a while; "": it works
  GstStructure* stats(CameraIndex camera) const;  // `stats` of the camera's lfcamsrc; owned by the caller
  // What comes from the camera's source: "JPEG", "YUY2", "H264 by RTP"; "" before the first frame, and of files and the
  // scene.
  std::string format(CameraIndex camera) const;
  uint64_t source_bytes(CameraIndex camera) const;  // bytes that the camera's source has given

 private:
  struct One;
  static void on_child(GstBin* pipeline, GstBin* parent, GstElement* child, gpointer one);
  void read_messages(GstClockTime timeout);

  std::shared_ptr<const Rig> rig_;
  Options options_;
  OnFrame on_frame_;
  GstElement* pipeline_ = nullptr;
  GstClock* clock_ = nullptr;
  std::vector<std::unique_ptr<One>> all_;  // by index in the rig; null for cameras that are not opened
};

// "3 (cam_00_03)".
std::string name_of(const Camera& camera);

// A rig file for as long as it lives, since cameras are opened by files. Files that the rig names are found from there.
class TemporaryRig {
 public:
  // `original`: what else the cameras have, such as their controls (rig/rig_json.h). `path`: the file that the rig was
  // read from. Its sources must be trusted (rig/source_security.h), because the copy belongs to this user in any case.
  // Throws Error.
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

// A camera that is plugged in.
struct VideoDevice {
  std::string name;     // the name that people know the camera by
  std::string source;   // what a rig has as source: a URI, or elements
  bool stable = false;  // the source means the same camera after a restart, or what else has been plugged in
};

// What GstDeviceMonitor finds under Video/Source, by whatever provider (v4l2, libcamera, Aravis, ...), in the order of
// the sources' numbers, each once. Sources: of V4L2 the link in `by_path` to the device's port on this machine
// (v4l2:///dev/v4l/by-path/...), else /dev/video0, which changes; of others their element with the properties that name
// the device. Screens, and what makes no element, are left out. gst_init() comes first.
std::vector<VideoDevice> find_video_devices(const std::string& by_path = "/dev/v4l/by-path");
