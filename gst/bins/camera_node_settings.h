// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <string>

namespace lf {

// lfcameranode's properties, but for those that are its lffragment's.
struct CameraNodeSettings {
  std::string rig;
  std::string cameras;
  int fps_n = 0, fps_d = 1;
  bool is_live = false;
  bool loop = false;
  bool decode = false;
  guint latency = 200;  // ms
  guint node = 0;
  bool retry = true;
  bool operator==(const CameraNodeSettings&) const = default;

  enum Property { kRig, kCameras, kFramerate, kIsLive, kLoop, kNode, kDecode, kLatency, kRetry, kNumProperties };
  // As properties first_id, first_id + 1, ... of the class.
  static void install(GObjectClass* klass, guint first_id);
  void set(Property property, const GValue* value);
  void get(Property property, GValue* value) const;
};

}  // namespace lf
