// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <string>

#include "common/properties.h"

namespace lf {

// lfcameranode's properties, but for those that are its lffragment's.
struct CameraNodeSettings {
  std::string rig;
  std::string cameras;
  int fps_n = 0, fps_d = 1;
  bool is_live = false;
  bool loop = false;
  bool decode = false;
  guint64 latency = 200 * GST_MSECOND;
  guint node = 0;
  bool retry = true;
  bool trusted = false;
  std::string record;
  bool operator==(const CameraNodeSettings&) const = default;

  static PropertyTable<CameraNodeSettings>& properties();
};

}  // namespace lf
