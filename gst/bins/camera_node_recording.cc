// SPDX-License-Identifier: LGPL-2.1-or-later
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "bins/lfcameranode_private.h"
#include "camsrc/lfcamsrc.h"
#include "common/guard.h"

// Both outlive the camera's streams.
void lf_camera_node_tap(LfCameraNode* self, GstElement* element, guint id) {
  LfCamSrc* camera = LF_CAM_SRC(element);
  lf_cam_src_set_keeper(camera, [=](GstBuffer* buffer, GstCaps* caps, GstClockTime captured) {
    const std::shared_ptr<lf::Recording> recording = lf_camera_node_recording(self);
    if (recording) recording->add(id, buffer, caps, captured, lf_cam_src_is_live(camera));
  });
}

std::shared_ptr<lf::Recording> lf_camera_node_recording(LfCameraNode* self) {
  const lf::ObjectLock lock(self);
  return *self->recording;
}

bool lf_camera_node_start_recording(LfCameraNode* self) {
  const std::string& folder = self->opened->record;
  if (folder.empty()) return true;
  try {
    const lf::Rig& rig = **self->rig;
    auto recording = std::make_shared<lf::Recording>(GST_ELEMENT(self), folder, rig, self->opened->rig,
                                                     lf::parse_camera_list(rig, self->opened->cameras));
    const lf::ObjectLock lock(self);
    *self->recording = std::move(recording);
    return true;
  } catch (const std::exception& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, OPEN_WRITE, ("record: %s", error.what()), (nullptr));
    return false;
  }
}

void lf_camera_node_finish_recording(LfCameraNode* self) {
  const std::shared_ptr<lf::Recording> recording = lf_camera_node_recording(self);
  if (!recording) return;
  recording->finish();
  const lf::ObjectLock lock(self);
  self->recording->reset();
}
