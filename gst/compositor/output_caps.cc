// SPDX-License-Identifier: LGPL-2.1-or-later
#include "compositor/output_caps.h"

#include "common/common.h"
#include "common/pixel_family.h"

namespace lf {

GstCaps* choose_output_caps(GstCaps* downstream, GstPad* request, PixelFamily family, int width, int height) {
  const auto candidates = [](const char* formats) {
    g_autofree gchar* text = g_strdup_printf("video/x-raw, format=(string)%s", formats);
    return gst_caps_from_string(text);
  };
  GstCaps* wanted = family == PixelFamily::kI420  ? candidates("{ I420, NV12 }")
                    : family == PixelFamily::kRgb ? candidates("{ " LF_RGB_FORMATS " }")
                                                  : candidates("{ " LF_RGB_FORMATS ", I420, NV12 }");
  GstCaps* sink_caps = gst_pad_get_current_caps(request);
  gint rate_n = 0, rate_d = 1;
  if (sink_caps) {
    gst_structure_get_fraction(gst_caps_get_structure(sink_caps, 0), "framerate", &rate_n, &rate_d);
    gst_caps_unref(sink_caps);
  }
  gst_caps_set_simple(wanted, "width", G_TYPE_INT, width, "height", G_TYPE_INT, height, "framerate", GST_TYPE_FRACTION,
                      rate_n, rate_d, "pixel-aspect-ratio", GST_TYPE_FRACTION, 1, 1, nullptr);
  GstCaps* chosen = gst_caps_intersect_full(wanted, downstream, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref(wanted);
  if (gst_caps_is_empty(chosen)) {
    gst_caps_unref(chosen);
    return nullptr;
  }
  chosen = gst_caps_fixate(chosen);
  GstVideoInfo info;
  if (gst_video_info_from_caps(&info, chosen)) {
    gst_caps_unref(chosen);
    set_system_colorimetry(info);
    chosen = gst_video_info_to_caps(&info);
  }
  return chosen;
}

}  // namespace lf
