// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>

#include <gst/gst.h>

#include "common/properties.h"
#include "view/view.h"

namespace lf {

// The size in pixels of one view's picture, and the frame rate. 0: not set.
struct PictureForm {
  int width = 0, height = 0;
  int fps_n = 0, fps_d = 1;
  bool operator==(const PictureForm&) const = default;
};

// `set`, completed with the values of `usual`.
PictureForm with_usual(const PictureForm& set, const PictureForm& usual);

// The form of pictures for elements that accept `caps`: numbers in `set` stay, and all others are as near to `usual` as
// the first suitable structure allows. Where caps fix one side of the picture, the other side keeps the shape of
// `usual`. A picture of `caps` has columns x rows views; pictures of several views have even sides. Nothing if no
// structure is suitable. `set` and `usual` are of one view; `usual` is set as a whole.
std::optional<PictureForm> fit_to_caps(const GstCaps* caps, const PictureForm& set, const PictureForm& usual,
                                       int columns, int rows);

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
