// SPDX-License-Identifier: LGPL-2.1-or-later
#include "compositor/output_caps.h"

#include <gst/video/video.h>

#include "common/common.h"
#include "common/pixel_family.h"

namespace lf {
namespace {

// Nothing is said of other layouts: players would show one view of them.
void set_multiview(GstCaps* caps, SetLayout layout) {
  const bool crossed = layout == SetLayout::kCrossEyed;
  const auto mode = layout == SetLayout::kTopBottom           ? GST_VIDEO_MULTIVIEW_MODE_TOP_BOTTOM
                    : layout == SetLayout::kStereo || crossed ? GST_VIDEO_MULTIVIEW_MODE_SIDE_BY_SIDE
                                                              : GST_VIDEO_MULTIVIEW_MODE_NONE;
  if (mode == GST_VIDEO_MULTIVIEW_MODE_NONE) return;
  const guint flags = crossed ? GST_VIDEO_MULTIVIEW_FLAGS_RIGHT_VIEW_FIRST : GST_VIDEO_MULTIVIEW_FLAGS_NONE;
  gst_caps_set_simple(caps, "multiview-mode", G_TYPE_STRING, gst_video_multiview_mode_to_caps_string(mode),
                      "multiview-flags", GST_TYPE_VIDEO_MULTIVIEW_FLAGSET, flags, GST_FLAG_SET_MASK_EXACT, nullptr);
}

// Where pictures of these caps are.
void put_in_card(GstCaps* caps) {
  gst_caps_set_features_simple(caps, gst_caps_features_new(LF_GL_MEMORY, nullptr));
  gst_caps_set_simple(caps, "texture-target", G_TYPE_STRING, "2D", nullptr);
}

}  // namespace

bool is_in_card(const GstCaps* caps) {
  const guint count = gst_caps_get_size(caps);
  for (guint i = 0; i < count; i++)
    if (!gst_caps_features_contains(gst_caps_get_features(caps, i), LF_GL_MEMORY)) return false;
  return count > 0 && !gst_caps_is_any(caps);
}

GstCaps* choose_output_caps(GstCaps* downstream, GstPad* request, PixelFamily family, int width, int height,
                            SetLayout layout) {
  constexpr char kRgb[] = "video/x-raw, format=(string){ " LF_RGB_FORMATS " }";
  // The cameras' range first, then video's, for those who ask for that.
  constexpr char kYCbCr[] = "video/x-raw, format=(string){ I420, NV12 }, colorimetry=(string){ 1:4:0:0, bt601 }";
  GstCaps* wanted = gst_caps_new_empty();
  if (family != PixelFamily::kI420) gst_caps_append(wanted, gst_caps_from_string(kRgb));
  if (family != PixelFamily::kRgb) gst_caps_append(wanted, gst_caps_from_string(kYCbCr));
  GstCaps* sink_caps = gst_pad_get_current_caps(request);
  gint rate_n = 0, rate_d = 1;
  if (sink_caps) {
    gst_structure_get_fraction(gst_caps_get_structure(sink_caps, 0), "framerate", &rate_n, &rate_d);
    gst_caps_unref(sink_caps);
  }
  gst_caps_set_simple(wanted, "width", G_TYPE_INT, width, "height", G_TYPE_INT, height, "framerate", GST_TYPE_FRACTION,
                      rate_n, rate_d, "pixel-aspect-ratio", GST_TYPE_FRACTION, 1, 1, nullptr);
  set_multiview(wanted, layout);
  // Who takes both gets what the CPU writes where it writes best.
  GstCaps* in_card = gst_caps_copy(wanted);
  put_in_card(in_card);
  gst_caps_append(wanted, in_card);
  GstCaps* chosen = gst_caps_intersect_full(wanted, downstream, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref(wanted);
  if (gst_caps_is_empty(chosen)) {
    gst_caps_unref(chosen);
    return nullptr;
  }
  chosen = gst_caps_fixate(chosen);
  GstVideoInfo info;
  if (gst_video_info_from_caps(&info, chosen)) {
    const GstVideoColorimetry asked_for = info.colorimetry;
    const bool has_headroom = has_video_levels(info);
    set_system_colorimetry(info);
    if (has_headroom) info.colorimetry = asked_for;
    GstCaps* exact = gst_video_info_to_caps(&info);
    if (is_in_card(chosen)) put_in_card(exact);
    gst_caps_replace(&chosen, exact);
    gst_caps_unref(exact);
  }
  return chosen;
}

}  // namespace lf
