// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/described_source.h"

#include "base/error.h"

namespace lf {
namespace {

// GStreamer takes caps between elements alone: one that does nothing goes behind those at the end.
std::string with_end(const std::string& line) {
  const size_t last = line.rfind(" ! ");
  const size_t begin = line.find_first_not_of(' ', last == std::string::npos ? 0 : last + 3);
  const size_t end = line.find_first_of("/ =", begin == std::string::npos ? 0 : begin);
  return end != std::string::npos && line[end] == '/' ? line + " ! identity" : line;
}

}  // namespace

GstElement* make_described_source(const std::string& line) {
  g_autoptr(GError) error = nullptr;
  GstElement* source =
      gst_parse_bin_from_description_full(with_end(line).c_str(), TRUE, nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error);
  const bool fits = source && !error && source->numsrcpads == 1 && source->numsinkpads == 0;
  if (fits) return source;
  if (source) gst_object_unref(gst_object_ref_sink(source));
  throw Error(error ? error->message : "must leave one source pad open, and no sink pad");
}

}  // namespace lf
