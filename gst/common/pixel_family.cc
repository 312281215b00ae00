// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/pixel_family.h"

namespace lf {

PixelFamily family_of(const GstVideoInfo& info) {
  switch (GST_VIDEO_INFO_FORMAT(&info)) {
    case GST_VIDEO_FORMAT_I420:
    case GST_VIDEO_FORMAT_NV12:
    case GST_VIDEO_FORMAT_GRAY8: return PixelFamily::kI420;
    default: break;
  }
  return GST_VIDEO_INFO_IS_RGB(&info) ? PixelFamily::kRgb : PixelFamily::kNone;
}

RgbLayout rgb_layout(const GstVideoInfo& info) {
  const auto offset = [&info](int component) {
    return static_cast<int>(GST_VIDEO_INFO_COMP_POFFSET(&info, component));
  };
  return {GST_VIDEO_INFO_COMP_PSTRIDE(&info, 0), offset(0), offset(1), offset(2)};
}

void set_system_colorimetry(GstVideoInfo& info) {
  if (family_of(info) != PixelFamily::kI420) return;
  gst_video_colorimetry_from_string(&info.colorimetry, "1:4:0:0");
  info.chroma_site = GST_VIDEO_CHROMA_SITE_JPEG;
}

bool has_video_levels(const GstVideoInfo& info) {
  return family_of(info) == PixelFamily::kI420 && info.colorimetry.range == GST_VIDEO_COLOR_RANGE_16_235;
}

}  // namespace lf
