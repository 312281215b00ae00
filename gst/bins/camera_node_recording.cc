// SPDX-License-Identifier: LGPL-2.1-or-later
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "bins/lfcameranode_private.h"
#include "camsrc/lfcamsrc.h"
#include "common/common.h"
#include "common/guard.h"

namespace {

struct Tap {
  LfCameraNode* node;  // both outlive the camera's pad
  LfCamSrc* camera;
  guint id;
};

GstClockTime capture_time(GstBuffer* frame) {
  static GstStaticCaps reference_caps = GST_STATIC_CAPS(LF_CAPTURE_TIME_CAPS);
  GstCaps* reference = gst_static_caps_get(&reference_caps);
  const GstReferenceTimestampMeta* meta = gst_buffer_get_reference_timestamp_meta(frame, reference);
  gst_caps_unref(reference);
  return meta ? meta->timestamp : GST_CLOCK_TIME_NONE;
}

GstPadProbeReturn on_frame(GstPad* pad, GstPadProbeInfo* info, gpointer data) {
  const auto* tap = static_cast<Tap*>(data);
  const std::shared_ptr<lf::Recording> recording = lf_camera_node_recording(tap->node);
  if (!recording) return GST_PAD_PROBE_OK;
  GstBuffer* frame = GST_PAD_PROBE_INFO_BUFFER(info);
  const GstClockTime captured = capture_time(frame);
  GstCaps* caps = GST_CLOCK_TIME_IS_VALID(captured) ? gst_pad_get_current_caps(pad) : nullptr;
  if (!caps) return GST_PAD_PROBE_OK;
  recording->add(tap->id, frame, caps, captured, lf_cam_src_is_live(tap->camera));
  gst_caps_unref(caps);
  return GST_PAD_PROBE_OK;
}

}  // namespace

// All that leaves the camera, with its true capture time.
void lf_camera_node_tap(LfCameraNode* self, GstElement* camera, guint id) {
  GstPad* pad = gst_element_get_static_pad(camera, "src");
  gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_BUFFER, lf::callback<on_frame>, new Tap{self, LF_CAM_SRC(camera), id},
                    [](gpointer tap) { delete static_cast<Tap*>(tap); });
  gst_object_unref(pad);
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
