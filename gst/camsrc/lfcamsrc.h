// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>

#include <gst/gst.h>

#include "camsrc/camera_lifecycle.h"

#define LF_TYPE_CAM_SRC (lf_cam_src_get_type())
G_DECLARE_FINAL_TYPE(LfCamSrc, lf_cam_src, LF, CAM_SRC, GstBin)

namespace lf {

// Function that receives the data of a camera for recording; see StreamOptions::tap.
using RecordingTap = std::function<void(GstBuffer* buffer, GstCaps* caps, GstClockTime captured)>;

}  // namespace lf

// Sets the function that receives the data for a recording, in a streaming thread. Call this before the camera is
// opened.
void lf_cam_src_set_tap(LfCamSrc* self, const lf::RecordingTap& tap);
// Tells the camera that other cameras can replace it, as in an lfcameranode. Its loss is then not an error even if the
// property `retry` is false, and `retry` applies only to live cameras. Thread-safe.
void lf_cam_src_set_optional(LfCamSrc* self);
const lf::CameraLifecycle& lf_cam_src_lifecycle(LfCamSrc* self);
// Returns true if frames arrive in real time and capture times are clock times. The answer is final after the first
// frame.
bool lf_cam_src_is_live(LfCamSrc* self);
// Returns the value of the property `stats` as a structure with this name. The caller owns the result.
GstStructure* lf_cam_src_stats(LfCamSrc* self, const char* name);
// Returns true if the camera is lost and will not be opened again.
bool lf_cam_src_is_lost_for_good(LfCamSrc* self);
