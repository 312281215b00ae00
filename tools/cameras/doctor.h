// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "cameras/links.h"
#include "quality/camera_monitor.h"
#include "rig/rig.h"
#include "rig/rig_json.h"

namespace lf::cameras {

struct CameraReport {
  CameraIndex camera = 0;
  Attachment attachment;
  std::string problem;  // error of lfcamsrc if the camera does not work; otherwise empty
  FrameTimeStats times;
  double delay = 0;  // median delay from capture to arrival, seconds
  // Offset of the capture times relative to the rest of the array, in seconds; positive if this camera is late.
  double phase = NAN;
  std::string format;  // format of the source, such as "JPEG" or "YUY2"; empty if unknown
  std::string stamps;  // origin of the capture times: "source", "sender-reports" (RTCP) or "arrival"
  size_t left_undecoded = 0;
  // frames that were decoded to measure the brightness, and frames that failed to decode
  size_t decoded_frames = 0, damaged = 0;
  std::string damage;
  double bytes_per_second = 0;
  // Brightness (mean luma of a frame, 0 to 255) of the latest, the darkest and the brightest frame.
  double brightness = NAN, darkest = NAN, brightest = NAN;
  Controls controls;  // control settings that the camera reports; nullopt if a control is automatic
  std::vector<std::string> unsupported_controls;
};

struct DoctorFinding {
  bool error = false;   // true if rendered views will suffer; false for a warning
  std::string cameras;  // affected camera, link or array, such as "camera 3 (cam_00_03)"
  std::string what, remedy;
};

// All results of a check: planned and measured loads of the USB buses and networks, the synchronisation of the cameras,
// and the problems.
struct DoctorReport {
  std::vector<CameraReport> cameras;
  std::vector<LinkLoad> planned, measured;
  Skew skew;
  std::vector<DoctorFinding> findings;  // errors first
  int errors() const;
};

struct DoctorOptions {
  double seconds = 4;    // observation time after all cameras deliver frames, seconds
  double timeout = 10;   // maximum time until the first frame of each camera, seconds
  bool trusted = false;  // allow any element as a camera source, see rig/source_security.h
  int fps = 0;           // frame rate requested from devices; 0: the device decides
  std::function<void(const std::vector<LinkLoad>&)> on_planned = {};
  std::function<void(double)> on_progress = {};  // 0 to 1; called on the caller's thread
};

// Opens all cameras of the rig at the same time and observes their frames, because an overloaded USB bus or network
// only shows if all cameras run together. `path` is the file of the rig. Throws Error if a GStreamer element is not
// installed.
DoctorReport run_doctor(std::shared_ptr<const Rig> rig, const std::string& path, const DoctorOptions& options);

// Estimates the load of each USB or network link without opening cameras. The estimate uses the image size, the frame
// rate in the source (or `fps`) and the format, which is raw if the source specifies this and otherwise JPEG.
std::vector<LinkLoad> planned_loads(const Rig& rig, const std::vector<CameraReport>& cameras, int fps);
// Returns the load of each link from the bytes that the cameras have delivered.
std::vector<LinkLoad> measured_loads(const Rig& rig, const std::vector<CameraReport>& cameras);

// Derives the problems from the observations in `exam`.
std::vector<DoctorFinding> find_problems(const Rig& rig, const DoctorReport& exam);

// Returns advice for the user about `problem`, an error text of lfcamsrc. The advice depends on whether the camera's
// source is a file or a device.
std::string remedy_for(const Camera& camera, const std::string& problem);

// Returns the loads of the links as a table with one line per link. `when` is "as planned" or "measured".
std::string link_table(const std::vector<LinkLoad>& loads, const char* when);
// Returns the report as text, without the planned loads. In a large array, all healthy cameras share one line.
std::string text_report(const Rig& rig, const DoctorReport& exam);
std::string json_report(const Rig& rig, const DoctorReport& exam);

}  // namespace lf::cameras
