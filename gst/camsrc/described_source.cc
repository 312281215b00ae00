// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/described_source.h"

#include "base/error.h"

namespace lf {
namespace {

constexpr char kEnd[] = "end-of-described-source";

}  // namespace

// An element that does nothing goes behind the line: it may end with caps, which stand between elements alone, or with
// an element whose pads come by and by.
GstElement* make_described_source(const std::string& line) {
  g_autoptr(GError) error = nullptr;
  const std::string whole = line + " ! identity name=" + kEnd;
  GstElement* source =
      gst_parse_bin_from_description_full(whole.c_str(), FALSE, nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error);
  const bool fits = source && !error && GST_OBJECT_FLAG_IS_SET(source, GST_ELEMENT_FLAG_SOURCE);
  if (!fits) {
    if (source) gst_object_unref(gst_object_ref_sink(source));
    throw Error(error ? error->message : "there is no source in it");
  }
  GstElement* end = gst_bin_get_by_name(GST_BIN(source), kEnd);
  GstPad* pad = gst_element_get_static_pad(end, "src");
  gst_element_add_pad(source, gst_ghost_pad_new("src", pad));
  gst_object_unref(pad);
  gst_object_unref(end);
  return source;
}

}  // namespace lf
