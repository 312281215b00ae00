// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>

#include <gst/gst.h>

#include "common/properties.h"
#include "view/view.h"

namespace lf {

// The size of one view in pixels, and the frame rate. 0 means not set.
struct PictureFormat {
  int width = 0, height = 0;
  int fps_n = 0, fps_d = 1;
  bool operator==(const PictureFormat&) const = default;
};

// Returns `set`, with each number that is not set (0) replaced by the number in `defaults`.
PictureFormat with_defaults(const PictureFormat& set, const PictureFormat& defaults);

// Chooses the size and frame rate of a view, so that its pictures fit the caps that downstream accepts. Numbers in
// `set` are fixed by the user. All unset numbers are chosen as close to `defaults` as the first suitable structure of
// the caps allows. If the caps fix only the width or only the height, the aspect ratio is preserved. Returns nothing if
// no structure is suitable.
//
// `set` and `defaults` describe one view, and `defaults` must be complete. A picture with several views has columns x
// rows views, and the sides of such a picture are even.
std::optional<PictureFormat> fit_to_caps(const GstCaps* caps, const PictureFormat& set, const PictureFormat& defaults,
                                         int columns, int rows);

inline constexpr char kFocusContinuous[] = "focus-continuous";
inline constexpr int kDefaultViewFps = 15;  // frames per second, if neither property nor caps define a rate

// The properties of lfviewrequest, except for the position of the view, which ViewControl stores.
struct ViewRequestSettings : ViewSet {
  static constexpr int kDefaultWidth = 640, kDefaultHeight = 480;  // size of views without a rig, in pixels

  std::string location, rig, out_of_service, navigation_element;
  guint view_id = 0;
  gint width = 0, height = 0;  // pixels; 0: from downstream caps, else from the rig
  gint fps_n = 0, fps_d = 1;   // 0: from downstream caps, else kDefaultViewFps
  gint64 capture_delay = -1;   // nanoseconds; -1: the delay that the nodes require
  bool navigation = true, constrain_view = true, loop = false, eager = false;
  guint quality = 90, nearest_cameras = 0;
  Access access = Access::kSelf;
  bool focus_continuous = false;
  // Number of requests before EOS; -1: unlimited. It replaces the property of GstBaseSrc, which would also count the
  // commands that follow requests.
  gint num_buffers = -1;

  // Returns a warning about settings that have no effect in combination with other settings. Empty if there are none.
  std::string ignored_settings(bool live) const;

  static PropertyTable<ViewRequestSettings>& properties();
};

}  // namespace lf
