// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/still_decoder.h"

#include <fstream>
#include <vector>

#include <gst/base/gsttypefindhelper.h>

namespace lf {
namespace {

// True if decodebin would use an installed decoder for these caps.
bool has_decoder(GstCaps* caps) {
  GList* all = gst_element_factory_list_get_elements(GST_ELEMENT_FACTORY_TYPE_DECODER, GST_RANK_MARGINAL);
  GList* decoders = gst_element_factory_list_filter(all, caps, GST_PAD_SINK, FALSE);
  const bool found = decoders != nullptr;
  gst_plugin_feature_list_free(decoders);
  gst_plugin_feature_list_free(all);
  return found;
}

}  // namespace

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
