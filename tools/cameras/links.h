// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "rig/rig.h"

namespace lf::cameras {

// The USB bus or network that carries the data of one or several cameras.
struct Link {
  enum class Kind { kNone, kUsb, kNetwork };
  Kind kind = Kind::kNone;
  // for example "USB bus 1 (480 Mbit/s)" or "network eth0"; cameras with equal names share the link
  std::string name;
  double capacity = 0;         // capacity for all cameras together, bytes per second; 0: unknown
  double camera_capacity = 0;  // maximum for a single camera, bytes per second; 0: the capacity of the link
};

struct Attachment {
  // Canonical name of the device, which is equal for all sources that open the same device. Empty for devices that
  // several sources may open.
  std::string device;
  Link link;
};

// Finds the link of a camera: the USB bus or the network that carries its data. The source is a V4L2 device or a
// network address, given as a URI or a launch description. Reads `sys` (normally /sys) and resolves host names. Never
// throws; fields stay empty if nothing is found.
Attachment find_attachment(const Rig& rig, const Camera& camera, const std::string& sys = "/sys");

// Returns the payload capacity (bytes per second) of a USB bus with this speed (Mbit/s). At high speed (480),
// isochronous transfers may use 80 % of a microframe (USB 2.0, 5.6.4), and one camera may use 3072 bytes of it (5.6.3).
// At higher speeds, the capacity is the rate without 8b/10b coding and headers.
Link usb_link(int bus, int speed);

struct LinkLoad {
  Link link;
  std::vector<CameraIndex> cameras;
  double needed = 0;      // sum over the cameras, bytes per second
  double max_needed = 0;  // maximum over the cameras, bytes per second
  double pixels = 0;      // sum over the cameras, pixels per second
  bool raw = false;
};

struct LinkWarning {
  bool overloaded = false;  // true if frames will be lost; false if little capacity is left
  std::string what, remedy;
};
// Returns warnings if a link is overloaded or has less than a fifth of its capacity free. Returns none if the capacity
// is unknown.
std::vector<LinkWarning> check_link(const LinkLoad& load);

// Typical bytes per pixel of a webcam's JPEG frames.
inline constexpr double kJpegBytesPerPixel = 0.25;

}  // namespace lf::cameras
