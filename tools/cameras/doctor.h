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

// What a camera of a rig delivered while it was watched.
struct CameraExam {
  CameraIndex camera = 0;
  Attachment attachment;
  std::string problem;                // why it did not work, as the light field says it; "": it did
  FrameTimes times;                   // times of capture
  double delay = 0;                   // median seconds from capture until a frame is here
  double phase = NAN;                 // seconds that the camera is behind the others
  std::string format;                 // what the source gives: "JPEG", "YUY2"; "": not known
  std::string stamps;                 // how capture times are known: "source", "sender-reports", "arrival"
  size_t left_undecoded = 0;          // frames left undecoded, as this machine can't decode all
  size_t looked_at = 0, damaged = 0;  // pictures that were decoded for their brightness, and those that could not be
  std::string damage;                 // of the latest damaged one
  double bytes_per_second = 0;
  double brightness = NAN, darkest = NAN, brightest = NAN;  // means of pictures, 0..255: the last one, and over time
  Controls controls;                                        // settings that the camera has; nothing: automatic
  std::vector<std::string> not_taken;                       // controls in the rig that the source does not know
};

struct Finding {
  bool error = false;   // the light field suffers; else it may
  std::string cameras;  // "camera 3 (cam_00_03)", or what else it is about
  std::string what, remedy;
};

struct Exam {
  std::vector<CameraExam> cameras;
  std::vector<LinkLoad> planned, measured;
  Skew skew;
  std::vector<Finding> findings;  // errors first
  int errors() const;
};

struct ExamOptions {
  double seconds = 4;    // seconds that cameras are watched, once they give frames
  double patience = 10;  // seconds in which cameras must begin to give frames
  bool trusted = false;  // the rig may run any element, see rig/source_security.h
  int fps = 0;           // frames per second that devices are asked for; 0: as they have it
  std::function<void(const std::vector<LinkLoad>&)> on_plan = {};  // told what links will carry, before cameras open
  std::function<void(double)> on_progress = {};  // how much of the watching is done, 0..1; on the caller's thread
};

// Opens every camera of the rig that was read from `path`, side by side, and watches them. Throws Error where
// GStreamer's parts are missing.
Exam examine(std::shared_ptr<const Rig> rig, const std::string& path, const ExamOptions& options);

// The loads of links by what the rig says alone: the size of its pictures, frames per second where a source says them
// (else `fps`), raw where a source says so and else JPEG.
std::vector<LinkLoad> planned_loads(const Rig& rig, const std::vector<CameraExam>& cameras, int fps);
std::vector<LinkLoad> measured_loads(const Rig& rig, const std::vector<CameraExam>& cameras);

// What is wrong with the cameras, and what helps.
std::vector<Finding> find_trouble(const Rig& rig, const Exam& exam);

// What helps where a camera does not work and that is why, in the light field's words or those of its source: of a film
// or still another thing than of what is plugged in.
std::string remedy_of(const Camera& camera, const std::string& problem);

// A line for each link. `when`: "as planned" or "measured".
std::string links_of(const std::vector<LinkLoad>& loads, const char* when);
// A page for people, without what was planned: healthy cameras of a large array are one line.
std::string page_of(const Rig& rig, const Exam& exam);
std::string json_of(const Rig& rig, const Exam& exam);

}  // namespace lf::cameras
