// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>

#include <gst/gst.h>

#include "camsrc/camera_service.h"

G_BEGIN_DECLS

#define LF_TYPE_CAM_SRC (lf_cam_src_get_type())
G_DECLARE_FINAL_TYPE(LfCamSrc, lf_cam_src, LF, CAM_SRC, GstBin)
GST_ELEMENT_REGISTER_DECLARE(lfcamsrc)

G_END_DECLS

namespace lf {

// Takes what is to be kept of a camera, StreamListener::on_keepsake.
using CameraKeeper = std::function<void(GstBuffer* buffer, GstCaps* caps, GstClockTime captured)>;

}  // namespace lf

// Who keeps what the camera gives; called by the threads that stream. Before the camera is opened.
void lf_cam_src_set_keeper(LfCamSrc* self, const lf::CameraKeeper& keeper);
// From now on the loss of this camera is no error, whatever the property `retry` says, which then counts for live
// cameras alone. For lfcameranode; any thread.
void lf_cam_src_set_expendable(LfCamSrc* self);
const lf::CameraService& lf_cam_src_service(LfCamSrc* self);
// Its frames come in real time, and their capture times are of the clock; known with the first frame.
bool lf_cam_src_is_live(LfCamSrc* self);
// The `stats` property under this name; owned by the caller.
GstStructure* lf_cam_src_stats(LfCamSrc* self, const char* name);
// Whether the camera is lost and no attempt to open it again follows.
bool lf_cam_src_is_lost_for_good(LfCamSrc* self);
