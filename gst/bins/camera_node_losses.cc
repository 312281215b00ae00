// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <optional>
#include <string>
#include <utility>

#include "base/schedule.h"
#include "bins/grouped_reasons.h"
#include "bins/lfcameranode_private.h"
#include "camsrc/lfcamsrc.h"
#include "common/common.h"
#include "common/guard.h"

using ElementPtr = std::unique_ptr<GstElement, decltype([](GstElement* element) { gst_object_unref(element); })>;

static std::vector<ElementPtr> lf_camera_node_cameras(LfCameraNode* self) {
  std::vector<ElementPtr> cameras;
  lf::ObjectLock lock(self);
  for (GstElement* camera : *self->cameras) cameras.emplace_back(GST_ELEMENT(gst_object_ref(camera)));
  lock.unlock();
  return cameras;
}

// Of a node none of whose cameras works.
struct Losses {
  bool has_worked = false, for_good = true;
  std::vector<std::string> reasons;
};

// Nothing where a camera works, or is still being opened for the first time.
static std::optional<Losses> lf_camera_node_losses(LfCameraNode* self) {
  Losses losses;
  for (const ElementPtr& camera : lf_camera_node_cameras(self)) {
    const lf::CameraService::Report report = lf_cam_src_service(LF_CAM_SRC(camera.get())).report();
    if (report.state != lf::CameraService::State::kLost) return std::nullopt;
    losses.has_worked = losses.has_worked || report.worked;
    losses.for_good = losses.for_good && lf_cam_src_is_lost_for_good(LF_CAM_SRC(camera.get()));
    losses.reasons.push_back(report.reason);
  }
  return losses;
}

static bool lf_camera_node_exchange(LfCameraNode* self, bool* flag, bool value) {
  GST_OBJECT_LOCK(self);
  const bool before = std::exchange(*flag, value);
  GST_OBJECT_UNLOCK(self);
  return before;
}

// All of them may come back.
static void lf_camera_node_tell_none_works(LfCameraNode* self, const Losses& losses) {
  if (lf_camera_node_exchange(self, &self->none_works, true)) return;
  // One that came back before the line above has not been noticed by it.
  if (!lf_camera_node_losses(self)) return lf_camera_node_note_found(self);
  const std::string reasons = lf::grouped_reasons(losses.reasons, "; ");
  GstStructure* structure =
      gst_structure_new(LF_NO_CAMERA, "cameras", G_TYPE_UINT, static_cast<guint>(losses.reasons.size()), "reason",
                        G_TYPE_STRING, reasons.c_str(), nullptr);
  gst_element_post_message(GST_ELEMENT(self), gst_message_new_element(GST_OBJECT(self), structure));
  GST_ELEMENT_WARNING(self, RESOURCE, NOT_FOUND, ("No camera works any more: %s", reasons.c_str()), (nullptr));
}

void lf_camera_node_check_cameras(LfCameraNode* self) {
  const std::optional<Losses> losses = lf_camera_node_losses(self);
  if (!losses) return;
  if (losses->has_worked && !losses->for_good) return lf_camera_node_tell_none_works(self, *losses);
  if (lf_camera_node_exchange(self, &self->failed, true)) return;
  GST_ELEMENT_ERROR(self, RESOURCE, NOT_FOUND,
                    ("No camera works:\n%s", lf::grouped_reasons(losses->reasons, "\n").c_str()), (nullptr));
}

void lf_camera_node_wait_for_cameras(LfCameraNode* self) {
  constexpr uint64_t kPatience = 2'000'000'000;
  const auto is_opening = [](const ElementPtr& camera) {
    return lf_cam_src_service(LF_CAM_SRC(camera.get())).state() == lf::CameraService::State::kOpening;
  };
  const std::vector<ElementPtr> cameras = lf_camera_node_cameras(self);
  for (const uint64_t end = lf::now_ns() + kPatience; lf::now_ns() < end && std::ranges::any_of(cameras, is_opening);)
    g_usleep(1000);
  lf_camera_node_check_cameras(self);  // a loss is noted before it is told
}

void lf_camera_node_note_found(LfCameraNode* self) { lf_camera_node_exchange(self, &self->none_works, false); }

bool lf_camera_node_has_failed(LfCameraNode* self) {
  GST_OBJECT_LOCK(self);
  const bool failed = self->failed;
  GST_OBJECT_UNLOCK(self);
  return failed;
}

void lf_camera_node_forget_failure(LfCameraNode* self) {
  GST_OBJECT_LOCK(self);
  self->failed = self->none_works = false;
  GST_OBJECT_UNLOCK(self);
}

GstStructure* lf_camera_node_stats(LfCameraNode* self) {
  GstStructure* stats = nullptr;
  if (self->fragment) g_object_get(self->fragment, "stats", &stats, nullptr);
  if (!stats) stats = gst_structure_new_empty("lightfield-fragment-stats");
  g_autoptr(GstStructure) cameras = gst_structure_new_empty("lightfield-cameras");
  const std::shared_ptr<lf::Recording> recording = lf_camera_node_recording(self);
  for (const ElementPtr& camera : lf_camera_node_cameras(self)) {
    guint id = 0;
    g_object_get(camera.get(), "camera", &id, nullptr);
    const std::string name = "camera-" + std::to_string(id);
    g_autoptr(GstStructure) one = lf_cam_src_stats(LF_CAM_SRC(camera.get()), name.c_str());
    if (recording) {
      const lf::CameraFile::Counts counts = recording->counts(id);
      gst_structure_set(one, "recorded", G_TYPE_UINT64, counts.frames, "unrecorded", G_TYPE_UINT64, counts.dropped,
                        nullptr);
    }
    gst_structure_set(cameras, name.c_str(), GST_TYPE_STRUCTURE, one, nullptr);
  }
  gst_structure_set(stats, "cameras", GST_TYPE_STRUCTURE, cameras, nullptr);
  if (recording) {
    g_autoptr(GstStructure) of_all = recording->stats();
    gst_structure_set(stats, "recording", GST_TYPE_STRUCTURE, of_all, nullptr);
  }
  return stats;
}
