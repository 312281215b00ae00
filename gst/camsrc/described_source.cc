// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/described_source.h"

#include "base/error.h"
#include "rig/bin_description.h"

namespace lf {
namespace {

constexpr char kEnd[] = "end-of-described-source";

// The text was checked before (rig/rig_trust.h), by a reader that knows a part of the language. This is the check of
// what GStreamer's own parser has made of it.
void require_listed_elements(GstBin* source) {
  for (const GList* item = source->children; item; item = item->next) {
    GstElementFactory* factory = gst_element_get_factory(GST_ELEMENT(item->data));
    const std::string name = factory ? GST_OBJECT_NAME(factory) : "a bin";
    if (!is_trusted_element(name)) throw Error("its source has " + name + ", which needs trusted=true");
  }
}

}  // namespace

// An element that does nothing goes behind the line: it may end with caps, which stand between elements alone, or with
// an element whose pads come by and by.
GstElement* make_described_source(const std::string& line, bool trusted) {
  g_autoptr(GError) error = nullptr;
  const std::string whole = line + " ! identity name=" + kEnd;
  GstElement* source =
      gst_parse_bin_from_description_full(whole.c_str(), FALSE, nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error);
  const bool fits = source && !error && GST_OBJECT_FLAG_IS_SET(source, GST_ELEMENT_FLAG_SOURCE);
  if (!fits) {
    if (source) gst_object_unref(gst_object_ref_sink(source));
    throw Error(error ? error->message : "there is no source in it");
  }
  try {
    if (!trusted) require_listed_elements(GST_BIN(source));
  } catch (const Error&) {
    gst_object_unref(gst_object_ref_sink(source));
    throw;
  }
  GstElement* end = gst_bin_get_by_name(GST_BIN(source), kEnd);
  GstPad* pad = gst_element_get_static_pad(end, "src");
  gst_element_add_pad(source, gst_ghost_pad_new("src", pad));
  gst_object_unref(pad);
  gst_object_unref(end);
  return source;
}

}  // namespace lf
