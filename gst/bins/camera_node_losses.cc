// SPDX-License-Identifier: LGPL-2.1-or-later
#include <string>
#include <utility>

#include "bins/lfcameranode_private.h"
#include "camsrc/lfcamsrc.h"
#include "common/guard.h"

using ElementPtr = std::unique_ptr<GstElement, decltype([](GstElement* element) { gst_object_unref(element); })>;

static std::vector<ElementPtr> lf_camera_node_cameras(LfCameraNode* self) {
  std::vector<ElementPtr> cameras;
  lf::ObjectLock lock(self);
  for (GstElement* camera : *self->cameras) cameras.emplace_back(GST_ELEMENT(gst_object_ref(camera)));
  lock.unlock();
  return cameras;
}

void lf_camera_node_check_cameras(LfCameraNode* self) {
  bool has_worked = false, for_good = true;
  std::string reasons;
  for (const ElementPtr& camera : lf_camera_node_cameras(self)) {
    const lf::CameraService::Report report = lf_cam_src_service(LF_CAM_SRC(camera.get())).report();
    if (report.state != lf::CameraService::State::kLost) return;
    has_worked = has_worked || report.worked;
    for_good = for_good && lf_cam_src_is_lost_for_good(LF_CAM_SRC(camera.get()));
    reasons += "\n" + report.reason;
  }
  if (has_worked && !for_good) return;
  GST_OBJECT_LOCK(self);
  const bool known = std::exchange(self->failed, true);
  GST_OBJECT_UNLOCK(self);
  if (!known) GST_ELEMENT_ERROR(self, RESOURCE, NOT_FOUND, ("No camera works:%s", reasons.c_str()), (nullptr));
}

bool lf_camera_node_has_failed(LfCameraNode* self) {
  GST_OBJECT_LOCK(self);
  const bool failed = self->failed;
  GST_OBJECT_UNLOCK(self);
  return failed;
}

void lf_camera_node_forget_failure(LfCameraNode* self) {
  GST_OBJECT_LOCK(self);
  self->failed = false;
  GST_OBJECT_UNLOCK(self);
}

GstStructure* lf_camera_node_stats(LfCameraNode* self) {
  GstStructure* stats = nullptr;
  if (self->fragment) g_object_get(self->fragment, "stats", &stats, nullptr);
  if (!stats) stats = gst_structure_new_empty("application/x-lightfield-fragment-stats");
  g_autoptr(GstStructure) cameras = gst_structure_new_empty("cameras");
  for (const ElementPtr& camera : lf_camera_node_cameras(self)) {
    guint id = 0;
    g_object_get(camera.get(), "camera", &id, nullptr);
    const std::string name = "camera-" + std::to_string(id);
    g_autoptr(GstStructure) one = lf_cam_src_stats(LF_CAM_SRC(camera.get()), name.c_str());
    gst_structure_set(cameras, name.c_str(), GST_TYPE_STRUCTURE, one, nullptr);
  }
  gst_structure_set(stats, "cameras", GST_TYPE_STRUCTURE, cameras, nullptr);
  return stats;
}
