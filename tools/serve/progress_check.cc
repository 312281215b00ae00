// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/progress_check.h"

#include <initializer_list>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

namespace lf::serve {
namespace {

// Each input of an element leads to one of the results soon.
struct Row {
  const char* source;
  std::initializer_list<const char*> inputs;
  const char* element;
  std::initializer_list<const char*> results;
};
const Row kRows[] = {
    {"lffragment", {"requests", "superseded"}, "lffragment", {"answers", "skipped", "refused", "bad-requests"}},
    {"rtplfdepay",
     {"bytes"},
     "lfcompositor",
     {"pictures", "skipped", "late-answers", "unexpected-answers", "repeated-answers", "bad-answers",
      "rig-mismatches"}},
};

bool is_of_type(GstElement* element, std::string_view type) {
  GstElementFactory* factory = gst_element_get_factory(element);
  return factory && type == GST_OBJECT_NAME(factory);
}

// Returns nothing if there is no element of this type.
std::optional<uint64_t> sum_of(const std::vector<ElementPtr>& elements, const char* type,
                               std::initializer_list<const char*> fields) {
  std::optional<uint64_t> sum;
  for (const ElementPtr& element : elements) {
    if (!is_of_type(element.get(), type)) continue;
    sum = sum.value_or(0);
    g_autoptr(GstStructure) stats = nullptr;
    g_object_get(element.get(), "stats", &stats, nullptr);
    for (const char* field : fields) {
      guint64 count = 0;
      if (stats && gst_structure_get_uint64(stats, field, &count)) *sum += count;
    }
  }
  return sum;
}

std::vector<ElementPtr> elements_of(GstElement* pipeline) {
  return take_elements(gst_bin_iterate_recurse(GST_BIN(pipeline)));
}

}  // namespace

std::string ProgressCheck::problem() {
  const std::string stopped = stopped_element(), blocked = blocked_sink();
  return blocked.empty() ? stopped : blocked;
}

std::string ProgressCheck::stopped_element() {
  const std::vector<ElementPtr> elements = elements_of(pipeline_);
  std::string problem;
  for (size_t i = 0; i < std::size(kRows); i++) {
    const Row& row = kRows[i];
    const auto in = sum_of(elements, row.source, row.inputs), out = sum_of(elements, row.element, row.results);
    if (!in || !out) continue;
    Counts& known = counts_[i];
    const bool has_result = *out != known.out, was_waiting = known.is_waiting;
    known = {*in, *out, !has_result && (was_waiting || *in != known.in)};
    if (was_waiting && known.is_waiting)
      problem = std::string(row.element) + " has input, but makes no " + *row.results.begin();
  }
  return problem;
}

// Returns true for sinks that keep a buffer until a client connects, such as srtsink at its defaults.
static bool waits_for_connection(GstElement* sink) {
  GParamSpec* property = g_object_class_find_property(G_OBJECT_GET_CLASS(sink), "wait-for-connection");
  gboolean waits = FALSE;
  if (property && property->value_type == G_TYPE_BOOLEAN) g_object_get(sink, "wait-for-connection", &waits, nullptr);
  return waits;
}

// A probe for idle pads is called when the sink has returned from the current buffer.
std::string ProgressCheck::blocked_sink() {
  std::string problem;
  std::map<std::string, std::shared_ptr<std::atomic<bool>>> found;
  for (const ElementPtr& element : elements_of(pipeline_)) {
    if (!GST_OBJECT_FLAG_IS_SET(element.get(), GST_ELEMENT_FLAG_SINK) || GST_IS_BIN(element.get()) ||
        waits_for_connection(element.get()))
      continue;
    const PadPtr sink(gst_element_get_static_pad(element.get(), "sink"));
    const PadPtr source(sink ? gst_pad_get_peer(sink.get()) : nullptr);
    if (!source) continue;
    g_autofree gchar* path = gst_object_get_path_string(GST_OBJECT(sink.get()));
    const auto known = is_busy_.find(path);
    if (known != is_busy_.end() && *known->second) {
      problem = std::string(GST_OBJECT_NAME(element.get())) + " does not return from a buffer";
      found[path] = known->second;
      continue;
    }
    using Flag = std::shared_ptr<std::atomic<bool>>;
    const Flag is_busy = found[path] = std::make_shared<std::atomic<bool>>(true);
    gst_pad_add_probe(
        source.get(), GST_PAD_PROBE_TYPE_IDLE,
        [](GstPad*, GstPadProbeInfo*, gpointer flag) {
          **static_cast<Flag*>(flag) = false;
          return GST_PAD_PROBE_REMOVE;
        },
        new Flag(is_busy), [](gpointer flag) { delete static_cast<Flag*>(flag); });
  }
  is_busy_ = std::move(found);
  return problem;
}

}  // namespace lf::serve
