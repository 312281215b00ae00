// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/coded_video.h"

namespace lf {
namespace {

// The parameter sets are in the stream and in the file header.
constexpr CodedVideo kKinds[] = {
    {"video/x-h264", "h264parse", "video/x-h264,stream-format=avc,alignment=au"},
    {"video/x-h265", "h265parse", "video/x-h265,stream-format=hvc1,alignment=au"},
    {"video/x-av1", "av1parse", "video/x-av1,stream-format=obu-stream,alignment=tu"},
    {"video/x-vp8", nullptr, "video/x-vp8"},
    {"video/x-vp9", nullptr, "video/x-vp9"},
};

bool is_installed(const char* factory_name) {
  GstElementFactory* factory = gst_element_factory_find(factory_name);
  const bool yes = factory != nullptr;
  gst_clear_object(&factory);
  return yes;
}

}  // namespace

const CodedVideo* find_coded_video(const GstCaps* caps) {
  const GstStructure* structure = gst_caps_get_structure(caps, 0);
  const gchar* alignment = gst_structure_get_string(structure, "alignment");
  if (alignment && (g_str_equal(alignment, "nal") || g_str_equal(alignment, "obu"))) return nullptr;
  for (const CodedVideo& kind : kKinds)
    if (gst_structure_has_name(structure, kind.name))
      return !kind.parser || is_installed(kind.parser) ? &kind : nullptr;
  return nullptr;
}

}  // namespace lf
