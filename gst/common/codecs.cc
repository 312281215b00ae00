// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/codecs.h"

#include <fstream>
#include <vector>

#include <gst/base/gsttypefindhelper.h>

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

// True if decodebin would use an installed decoder for these still images and the decoder works. The decoders of libav
// find no valid frame in a TIFF file, because GStreamer 1.22 has no parser that divides the stream into pictures.
bool has_decoder(GstCaps* caps) {
  GList* all = gst_element_factory_list_get_elements(GST_ELEMENT_FACTORY_TYPE_DECODER, GST_RANK_MARGINAL);
  GList* decoders = gst_element_factory_list_filter(all, caps, GST_PAD_SINK, FALSE);
  bool found = false;
  for (const GList* each = decoders; each; each = each->next)
    found |= !g_str_has_prefix(GST_OBJECT_NAME(each->data), "avdec_");
  gst_plugin_feature_list_free(decoders);
  gst_plugin_feature_list_free(all);
  return found;
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

std::string still_decoding_problem(const std::string& path) {
  constexpr size_t kHeader = 64 << 10;
  std::vector<guint8> bytes(kHeader);
  std::ifstream file(path, std::ios::binary);
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<size_t>(file.gcount()));
  constexpr char kRemedy[] = "; convert the picture to JPEG or PNG";
  g_autoptr(GstCaps) caps =
      bytes.empty() ? nullptr : gst_type_find_helper_for_data(nullptr, bytes.data(), bytes.size(), nullptr);
  if (!caps) return std::string("the format of the file is unknown") + kRemedy;
  const std::string type = gst_structure_get_name(gst_caps_get_structure(caps, 0));
  if (type.starts_with("video/"))
    return "the file is " + type + ": convert an HEIC picture to JPEG, and enter a film as source";
  if (!type.starts_with("image/")) return "the file is " + type + ", not an image";
  return has_decoder(caps) ? "" : "no installed GStreamer plug-in decodes " + type + kRemedy;
}

}  // namespace lf
