// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/camera_source.h"

#include <gst/gst.h>

namespace lf {
namespace {

// Whether the source of the URI has pictures on a pad of its own, in place of bytes or packets.
bool gives_pictures(const std::string& uri) {
  GstElement* source = gst_element_make_from_uri(GST_URI_SRC, uri.c_str(), nullptr, nullptr);
  if (!source) return false;
  gst_object_ref_sink(source);
  bool pictures = false;
  if (GstPad* pad = gst_element_get_static_pad(source, "src")) {
    GstCaps* caps = gst_pad_get_pad_template_caps(pad);
    for (guint i = 0; i < gst_caps_get_size(caps) && !gst_caps_is_any(caps); i++) {
      const gchar* name = gst_structure_get_name(gst_caps_get_structure(caps, i));
      pictures |= g_str_equal(name, "video/x-raw") || g_str_equal(name, "image/jpeg");
    }
    gst_caps_unref(caps);
    gst_object_unref(pad);
  }
  gst_object_unref(source);
  return pictures;
}

}  // namespace

CameraSource find_playable_source(const Rig& rig, const Camera& camera) {
  CameraSource source = find_camera_source(rig, camera);
  if (source.kind == CameraSource::Kind::kUri && gives_pictures(source.location))
    source.kind = CameraSource::Kind::kDevice;
  return source;
}

}  // namespace lf
