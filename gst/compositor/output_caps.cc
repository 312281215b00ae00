// SPDX-License-Identifier: LGPL-2.1-or-later
#include "compositor/output_caps.h"

#include <gst/video/video.h>

#include <initializer_list>
#include <string>

#include "common/buffer_ptr.h"
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

// Video of this family in the computer's memory. The cameras' range first, then video's, for those who ask for that.
GstCaps* caps_of_family(PixelFamily family) {
  constexpr char kRgb[] = "video/x-raw, format=(string){ " LF_RGB_FORMATS " }";
  constexpr char kYCbCr[] = "video/x-raw, format=(string){ I420, NV12 }, colorimetry=(string){ 1:4:0:0, bt601 }";
  GstCaps* caps = gst_caps_new_empty();
  if (family != PixelFamily::kI420) gst_caps_append(caps, gst_caps_from_string(kRgb));
  if (family != PixelFamily::kRgb) gst_caps_append(caps, gst_caps_from_string(kYCbCr));
  return caps;
}

// Of the requests; 0/1 where they have none.
void request_rate(GstPad* request, gint* numerator, gint* denominator) {
  *numerator = 0, *denominator = 1;
  const SharedCaps caps = share_caps(gst_pad_get_current_caps(request));
  if (caps) gst_structure_get_fraction(gst_caps_get_structure(caps.get(), 0), "framerate", numerator, denominator);
}

// Which values of a field are accepted, in a few words.
std::string accepted_values(const GstCaps* caps, std::initializer_list<const char*> fields) {
  std::string all;
  for (guint i = 0; i < gst_caps_get_size(caps); i++) {
    std::string one;
    for (const char* field : fields) {
      const GValue* value = gst_structure_get_value(gst_caps_get_structure(caps, i), field);
      if (!value) continue;
      g_autofree gchar* text = gst_value_serialize(value);
      one += (one.empty() ? "" : ",") + std::string(field) + "=" + text;
    }
    if (!one.empty() && all.find(one) == std::string::npos) all += (all.empty() ? "" : " or ") + one;
  }
  return all.empty() ? "nothing of that kind" : all;
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
  GstCaps* wanted = caps_of_family(family);
  gint rate_n = 0, rate_d = 1;
  request_rate(request, &rate_n, &rate_d);
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

GstCaps* offered_caps(PixelFamily family) {
  GstCaps* caps = caps_of_family(family);
  for (guint i = 0; i < gst_caps_get_size(caps); i++)
    gst_structure_remove_field(gst_caps_get_structure(caps, i), "colorimetry");
  GstCaps* in_card = gst_caps_copy(caps);
  gst_caps_set_features_simple(in_card, gst_caps_features_new(LF_GL_MEMORY, nullptr));
  gst_caps_append(caps, in_card);
  return caps;
}

CapsMismatch explain_mismatch(const GstCaps* downstream, GstPad* request, PixelFamily family, int width, int height) {
  const char* name = family == PixelFamily::kI420  ? "I420 or NV12"
                     : family == PixelFamily::kRgb ? "RGB"
                                                   : "RGB or I420";
  const SharedCaps formats = share_caps(caps_of_family(family));
  GstCaps* both = gst_caps_copy(formats.get());
  GstCaps* in_card = gst_caps_copy(formats.get());
  put_in_card(in_card);
  gst_caps_append(both, in_card);
  const SharedCaps fits =
      share_caps(gst_caps_intersect_full(both, const_cast<GstCaps*>(downstream), GST_CAPS_INTERSECT_FIRST));
  gst_caps_unref(both);
  const auto text = [](const char* format, auto... values) {
    g_autofree gchar* made = g_strdup_printf(format, values...);
    return std::string(made);
  };
  if (gst_caps_is_empty(fits.get())) {
    const bool in_card_alone = is_in_card(downstream);
    return {false,
            text("The pictures of these cameras are %s video, but downstream accepts %s%s: put %s in between.", name,
                 accepted_values(downstream, {"format"}).c_str(), in_card_alone ? " in a graphics card's memory" : "",
                 in_card_alone ? "glupload ! glcolorconvert" : "a videoconvert")};
  }
  gint rate_n = 0, rate_d = 1;
  request_rate(request, &rate_n, &rate_d);
  const auto allows = [&fits](auto... fields) {
    g_autoptr(GstStructure) only = gst_structure_new("video/x-raw", fields..., nullptr);
    for (guint i = 0; i < gst_caps_get_size(fits.get()); i++)
      if (gst_structure_can_intersect(gst_caps_get_structure(fits.get(), i), only)) return true;
    return false;
  };
  if (!allows("width", G_TYPE_INT, width, "height", G_TYPE_INT, height))
    return {true,
            text("The view's pictures have %dx%d pixels, but downstream accepts %s: leave the viewer's properties "
                 "width and height at 0 so that the size follows, or put a videoscale in between. Views of a "
                 "file (location) have the file's sizes.",
                 width, height, accepted_values(fits.get(), {"width", "height"}).c_str())};
  if (!allows("framerate", GST_TYPE_FRACTION, rate_n, rate_d))
    return {true, text("Pictures come at %d/%d a second, but downstream accepts %s: leave the viewer's property "
                       "framerate at 0/1 so that the rate follows, or put a videorate in between.",
                       rate_n, rate_d, accepted_values(fits.get(), {"framerate"}).c_str())};
  if (!allows("pixel-aspect-ratio", GST_TYPE_FRACTION, 1, 1))
    return {false, text("Pictures have square pixels, but downstream accepts %s: put a videoscale in between.",
                        accepted_values(fits.get(), {"pixel-aspect-ratio"}).c_str())};
  if (is_in_card(downstream))
    return {false,
            text("Downstream accepts %s video of %dx%d pixels in a graphics card's memory alone, and there is no "
                 "OpenGL for it: put glupload ! glcolorconvert before that element and its caps. Without a "
                 "display GStreamer needs GST_GL_PLATFORM=egl and GST_GL_WINDOW=egl-device.",
                 name, width, height)};
  g_autofree gchar* accepted = gst_caps_to_string(downstream);
  return {false, text("Downstream accepts no %s video of %dx%d pixels at %d/%d pictures a second, but %s: put a "
                      "videoconvert in between.",
                      name, width, height, rate_n, rate_d, accepted)};
}

}  // namespace lf
