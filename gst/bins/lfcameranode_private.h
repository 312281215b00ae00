// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <vector>

#include "bins/camera_node_settings.h"
#include "bins/lfcameranode.h"
#include "recording/recording.h"
#include "rig/rig.h"

// What the files of lfcameranode share: lfcameranode.cc (the element), camera_node_losses.cc (what becomes of it where
// cameras fail) and camera_node_recording.cc (what its cameras give, on disk).

struct _LfCameraNode {
  GstBin parent;
  GstElement* fragment;                 // borrowed from the bin's children; null where lffragment is not installed
  lf::CameraNodeSettings* settings;     // under the object lock
  lf::CameraNodeSettings* opened;       // what the children were made for
  std::shared_ptr<const lf::Rig>* rig;  // the same
  std::vector<GstElement*>* cameras;    // borrowed from the bin's children; under the object lock
  std::shared_ptr<lf::Recording>* recording;  // null where nothing is recorded; under the object lock
  bool failed;                                // no camera works, which ends the node; under the object lock
  bool none_works;                            // no camera works for now, and that has been told; the same
};

// A camera has been lost: if none works any more that is an error, or where one has worked before and some may come
// back a warning and an element message, once until one is back. Any thread.
void lf_camera_node_check_cameras(LfCameraNode* self);
// A camera is back. Any thread.
void lf_camera_node_note_found(LfCameraNode* self);
// Whether that error has been posted since it was forgotten.
// Waits, for a limited time, until each camera has a first frame or is lost. Then lf_camera_node_has_failed() tells of
// an error at the start.
void lf_camera_node_wait_for_cameras(LfCameraNode* self);
bool lf_camera_node_has_failed(LfCameraNode* self);
void lf_camera_node_forget_failure(LfCameraNode* self);
// A camera that has just been made: what it gives is recorded while there is a recording.
void lf_camera_node_tap(LfCameraNode* self, GstElement* camera, guint id);
// From now on, between two starts, its cameras are recorded, if its property says so. False, after posting the reason,
// where they can't be.
bool lf_camera_node_start_recording(LfCameraNode* self);
// When they have stopped.
void lf_camera_node_finish_recording(LfCameraNode* self);
// Null where nothing is recorded.
std::shared_ptr<lf::Recording> lf_camera_node_recording(LfCameraNode* self);
// The `stats` property: what lffragment counts, and the structure `cameras` of one for each, camera-ID. Owned by the
// caller.
GstStructure* lf_camera_node_stats(LfCameraNode* self);
