// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "rig/rig.h"

namespace lf::cameras {

// What a camera's pictures come by to this machine.
struct Link {
  enum class Kind { kNone, kUsb, kNetwork };
  Kind kind = Kind::kNone;
  std::string name;            // "USB bus 1 (480 Mbit/s)", "network eth0"; cameras with the same share it
  double capacity = 0;         // bytes of pictures per second for all cameras together; 0: not known
  double camera_capacity = 0;  // bytes per second that one camera can use at most; 0: as many as the link has
};

struct Attachment {
  std::string device;  // what the source opens, by its true name; cameras with the same are one; "": may be shared
  Link link;
};

// The links of a camera with a V4L2 device or an address, by URI or by elements. Looks into `sys`, the kernel's /sys;
// names of hosts are resolved. Never throws: what can't be found is left empty.
Attachment find_attachment(const Rig& rig, const Camera& camera, const std::string& sys = "/sys");

// What is left of a USB's speed (Mbit/s) for pictures. High speed: isochronous transfers may have 80 % of a microframe
// (USB 2.0, 5.6.4), and one camera 3072 bytes of each (5.6.3). Above: what 8b/10b and headers leave.
Link usb_link(int bus, int speed);

// Pictures on a link: how much they need, as planned or as measured.
struct LinkLoad {
  Link link;
  std::vector<CameraIndex> cameras;
  double needed = 0;       // bytes per second of all cameras
  double most_needed = 0;  // bytes per second of the camera that needs most
  double pixels = 0;       // per second of all
  bool raw = false;        // pictures are not compressed
};

struct LinkAdvice {
  bool too_much = false;  // pictures will be lost; else little is left
  std::string what, remedy;
};
// What is wrong with a link; nothing for one whose capacity is not known, or that has a fifth of it left.
std::vector<LinkAdvice> advise(const LinkLoad& load);

// Bytes that a webcam's JPEG has for a pixel, about.
inline constexpr double kJpegBytesPerPixel = 0.25;

}  // namespace lf::cameras
