// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <string>

#include "common/properties.h"

namespace lf {

// lfcamsrc's properties.
struct CamSrcSettings {
  std::string rig;
  guint camera = 0;  // id
  int fps_n = 0, fps_d = 1;
  bool is_live = false;
  bool loop = false;
  gint64 num_frames = -1;
  bool decode = true;
  guint64 latency = 200 * GST_MSECOND;
  bool retry = false;
  bool trusted = false;
  bool operator==(const CamSrcSettings&) const = default;

  static PropertyTable<CamSrcSettings>& properties();
};

}  // namespace lf
