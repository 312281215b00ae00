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
  std::string problem;  // why the camera failed, from lfcamsrc; "": it works
  FrameTimeStats times;
  double delay = 0;    // median delay from capture to arrival, seconds
  double phase = NAN;  // offset from the other cameras, seconds; positive: late
  std::string format;  // format of the source: "JPEG", "YUY2"; "": unknown
  std::string stamps;  // origin of capture times: "source", "sender-reports", "arrival"
  size_t left_undecoded = 0;
  size_t decoded_frames = 0, damaged = 0;  // frames decoded to measure brightness; frames that failed to decode
  std::string damage;
  double bytes_per_second = 0;
  // mean brightness of a frame, 0..255: latest, minimum, maximum
  double brightness = NAN, darkest = NAN, brightest = NAN;
  Controls controls;  // settings reported by the camera; nullopt: automatic
  // controls in the rig that the source does not support
  std::vector<std::string> unsupported_controls;
};

struct DoctorFinding {
  bool error = false;   // true: the light field suffers; false: a warning
  std::string cameras;  // "camera 3 (cam_00_03)", or the affected link or array
  std::string what, remedy;
};

struct DoctorReport {
  std::vector<CameraReport> cameras;
  std::vector<LinkLoad> planned, measured;
  Skew skew;
  std::vector<DoctorFinding> findings;  // errors first
  int errors() const;
};

struct DoctorOptions {
  double seconds = 4;    // observation time, seconds, after the cameras deliver frames
  double timeout = 10;   // seconds until every camera must have delivered a frame
  bool trusted = false;  // allow any element as a source, see rig/source_security.h
  int fps = 0;           // frames per second requested from devices; 0: device default
  std::function<void(const std::vector<LinkLoad>&)> on_planned = {};
  std::function<void(double)> on_progress = {};  // receives the progress, 0..1; called on the caller's thread
};

// Opens all cameras of the rig, which was read from `path`, and observes them together. Throws Error if GStreamer
// elements are missing.
DoctorReport run_doctor(std::shared_ptr<const Rig> rig, const std::string& path, const DoctorOptions& options);

// Estimates link loads from the rig: image size, frame rate of the source description (default: `fps`), and format (raw
// if the source says so, otherwise JPEG).
std::vector<LinkLoad> planned_loads(const Rig& rig, const std::vector<CameraReport>& cameras, int fps);
std::vector<LinkLoad> measured_loads(const Rig& rig, const std::vector<CameraReport>& cameras);

std::vector<DoctorFinding> find_problems(const Rig& rig, const DoctorReport& exam);

// Returns a remedy for `problem`, an error of lfcamsrc or of the camera's source. The remedy differs for files and for
// devices.
std::string remedy_for(const Camera& camera, const std::string& problem);

// Returns one line per link. `when`: "as planned" or "measured".
std::string link_table(const std::vector<LinkLoad>& loads, const char* when);
// Returns a report for people, without the planned loads. Healthy cameras of a large array share one line.
std::string text_report(const Rig& rig, const DoctorReport& exam);
std::string json_report(const Rig& rig, const DoctorReport& exam);

}  // namespace lf::cameras
