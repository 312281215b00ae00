// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <string>

#include "common/access.h"
#include "common/properties.h"
#include "view/view_set.h"

namespace lf {

inline constexpr char kFocusContinuous[] = "focus-continuous";
inline constexpr int kUsualFps = 15;  // frames per second where neither the property nor caps name a rate

// Property "views": lf::SetLayout.
#define LF_TYPE_SET_LAYOUT (lf_set_layout_get_type())

// lfviewrequest's properties but for the numbers of the view itself (view_control.h).
struct ViewRequestSettings : ViewSet {
  static constexpr int kDefaultWidth = 640, kDefaultHeight = 480;  // pixels of views where there is no rig

  std::string location, rig, out_of_service, navigation_from;
  guint view_id = 0;
  gint width = 0, height = 0;                        // 0: as downstream caps say, else as the rig's cameras
  gint fps_n = 0, fps_d = 1;                         // 0: as downstream caps say, else kUsualFps
  GstClockTime capture_delay = GST_CLOCK_TIME_NONE;  // NONE: as nodes need it
  bool navigation = true, keep_visible = true, loop = false, eager = false;
  guint quality = 90, nearest_cameras = 0;
  Access access = Access::kSelf;
  bool focus_continuous = false;
  // The property of GstBaseSrc, which would count what goes along with requests, too. -1: no end.
  gint num_buffers = -1;

  // What is set and can have no effect beside the other settings, and why, for a person to read; empty if nothing is.
  std::string without_effect(bool live) const;

  static PropertyTable<ViewRequestSettings>& properties();
};

}  // namespace lf

GType lf_set_layout_get_type(void);
