// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "rig/rig.h"

namespace lf::cameras {

struct Link {
  enum class Kind { kNone, kUsb, kNetwork };
  Kind kind = Kind::kNone;
  std::string name;            // "USB bus 1 (480 Mbit/s)", "network eth0"; cameras with equal names share the link
  double capacity = 0;         // bytes per second available to all cameras together; 0: unknown
  double camera_capacity = 0;  // maximum bytes per second of one camera; 0: no limit except the link's
};

struct Attachment {
  // canonical name of the device that the source opens; equal names mean the same device; "": sharing is allowed
  std::string device;
  Link link;
};

// Finds the link of a camera with a V4L2 device or a network address, given as a URI or a launch description. Reads
// `sys`, the kernel's /sys, and resolves host names. Never throws; fields stay empty if nothing is found.
Attachment find_attachment(const Rig& rig, const Camera& camera, const std::string& sys = "/sys");

// Returns the payload capacity of a USB bus with this speed (Mbit/s). High speed: isochronous transfers may use 80 % of
// a microframe (USB 2.0, 5.6.4), one camera at most 3072 bytes (5.6.3). Higher speeds: the rate minus 8b/10b coding and
// headers.
Link usb_link(int bus, int speed);

struct LinkLoad {
  Link link;
  std::vector<CameraIndex> cameras;
  double needed = 0;      // bytes per second, sum over the cameras
  double max_needed = 0;  // bytes per second of the most demanding camera
  double pixels = 0;      // pixels per second, sum over the cameras
  bool raw = false;
};

struct LinkWarning {
  bool overloaded = false;  // true: frames will be lost; false: little capacity is left
  std::string what, remedy;
};
// Returns warnings for a link. Empty if the capacity is unknown or at least a fifth of it is free.
std::vector<LinkWarning> check_link(const LinkLoad& load);

// typical bytes per pixel of a webcam's JPEG frames
inline constexpr double kJpegBytesPerPixel = 0.25;

}  // namespace lf::cameras
