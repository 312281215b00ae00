// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/pipeline_monitor.h"

#include <algorithm>
#include <initializer_list>
#include <memory>
#include <optional>
#include <sstream>
#include <utility>
#include <vector>

namespace lf::serve {
namespace {

// A metric that is a field of the property `stats`.
struct Row {
  const char *element, *field, *name, *help;
  bool is_gauge = false;  // gauges of several elements: the largest value; counters: the sum
  double unit = 1;
};

constexpr Row kRows[] = {
    {"lffragment", "requests", "requests_total", "View requests."},
    {"lffragment", "answers", "answers_total", "Answers to view requests."},
    {"lffragment", "bytes", "answer_bytes_total", "Bytes of answers."},
    {"lffragment", "skipped", "skipped_requests_total", "Requests without an answer, which would have been too late."},
    {"lffragment", "superseded", "superseded_requests_total", "Requests that were replaced by newer requests."},
    {"lffragment", "refused", "refused_requests_total", "Requests that exceeded a limit."},
    {"lffragment", "bad-requests", "bad_requests_total", "Invalid requests."},
    {"lffragment", "missing-frames", "missing_frames_total", "Camera frames that were missing in answers."},
    {"lffragment", "stale-frames", "stale_frames_total", "Camera frames that were too old for their answer."},
    {"lffragment", "max-skew-ns", "answer_skew_max_seconds",
     "Largest difference between the captured and the requested time since the start.", true, 1e-9},
    {"lfcompositor", "pictures", "pictures_total", "Pictures composed."},
    {"lfcompositor", "incomplete", "incomplete_pictures_total", "Incomplete pictures."},
    {"lfcompositor", "dropped", "dropped_pictures_total", "Pictures that were not delivered."},
    {"lfcompositor", "skipped", "skipped_pictures_total",
     "Requests without a picture, which would have been too late."},
    {"lfcompositor", "late-answers", "late_answers_total", "Answers after the deadline of their picture."},
    {"lfcompositor", "bad-answers", "bad_answers_total", "Invalid answers."},
    {"lfcompositor", "rig-mismatches", "rig_mismatches_total", "Answers of hosts with another rig."},
    {"lfcompositor", "bytes", "composed_bytes_total", "Bytes of answers used in pictures."},
    {"lfcompositor", "out-of-service", "cameras_out_of_service", "Cameras that other cameras replace.", true},
    {"rtplfdepay", "bytes", "received_bytes_total", "Bytes of received RTP payloads."},
    {"rtplfdepay", "lost", "lost_packets_total", "RTP packets that did not arrive."},
    {"rtplfdepay", "incomplete-units", "incomplete_units_total", "Messages with missing packets."},
    {"rtplfpay", "bytes", "sent_bytes_total", "Bytes of sent RTP packets."},
    {"lfrtpgate", "passed", "accepted_packets_total", "Packets from known hosts."},
};
constexpr const char* kGateReasons[] = {"malformed", "unsealed", "stale", "replayed", "forged", "unknown-senders"};
constexpr Row kCameraRows[] = {
    {"lfcamsrc", "losses", "camera_losses_total", "Failures of the camera."},
    {"lfcamsrc", "dropped", "camera_dropped_frames_total", "Frames that were skipped because the host is too slow."},
    {"lfcamsrc", "damaged", "camera_damaged_frames_total", "Frames that cannot be decoded."},
};

std::string type_of(GstElement* element) {
  GstElementFactory* factory = gst_element_get_factory(element);
  return factory ? GST_OBJECT_NAME(factory) : "";
}

bool has_property(GstElement* element, const char* name) {
  return g_object_class_find_property(G_OBJECT_GET_CLASS(element), name);
}

std::vector<ElementPtr> elements_of(GstElement* pipeline) {
  return take_elements(gst_bin_iterate_recurse(GST_BIN(pipeline)));
}

uint64_t count_in(const GstStructure* stats, const char* field) {
  guint64 count = 0;
  gst_structure_get_uint64(stats, field, &count);
  return count;
}

double seconds_in(const GstStructure* message, std::initializer_list<const char*> fields) {
  uint64_t sum = 0;
  for (const char* field : fields) sum += count_in(message, field);
  return static_cast<double>(sum) * 1e-9;
}

std::string head(const Row& row) {
  const std::string name = std::string("lightfield_") + row.name;
  return "# HELP " + name + ' ' + row.help + "\n# TYPE " + name + (row.is_gauge ? " gauge\n" : " counter\n");
}

}  // namespace

PipelineMetrics::PipelineMetrics(GstElement* pipeline) : pipeline_(pipeline) {
  g_signal_connect(pipeline, "deep-element-added",
                   G_CALLBACK(+[](GstBin*, GstBin*, GstElement* element, gpointer data) {
                     static_cast<PipelineMetrics*>(data)->watch(element);
                   }),
                   this);
  for (const ElementPtr& element : elements_of(pipeline)) watch(element.get());
}

void PipelineMetrics::watch(GstElement* element) {
  const std::string type = type_of(element);
  if (type.starts_with("lf") && has_property(element, "post-messages"))
    g_object_set(element, "post-messages", TRUE, nullptr);
  if (type != "lfcamsrc") return;
  // The element gets its number after it is added, so the first frame looks it up.
  struct Probe {
    PipelineMetrics* metrics;
    std::atomic<int64_t>* last = nullptr;
  };
  g_autoptr(GstPad) pad = gst_element_get_static_pad(element, "src");
  gst_pad_add_probe(
      pad, GST_PAD_PROBE_TYPE_BUFFER,
      [](GstPad* pad, GstPadProbeInfo*, gpointer data) {
        auto& [metrics, last] = *static_cast<Probe*>(data);
        if (!last) {
          g_autoptr(GstElement) camera = gst_pad_get_parent_element(pad);
          guint id = 0;
          if (camera) g_object_get(camera, "camera", &id, nullptr);
          const std::lock_guard lock(metrics->mutex_);
          last = &metrics->last_frames_[id];
        }
        *last = g_get_monotonic_time();
        return GST_PAD_PROBE_OK;
      },
      new Probe{this}, [](gpointer data) { delete static_cast<Probe*>(data); });
}

bool PipelineMetrics::take(GstMessage* message) {
  const GstStructure* fields = gst_message_get_structure(message);
  if (GST_MESSAGE_TYPE(message) != GST_MESSAGE_ELEMENT || !fields) return false;
  if (gst_structure_has_name(fields, "lightfield-answer")) {
    answers_.add(seconds_in(fields, {"wait-ns", "decode-ns", "render-ns", "encode-ns"}));
    return true;
  }
  if (!gst_structure_has_name(fields, "lightfield-view")) return false;
  pictures_.add(seconds_in(fields, {"latency-ns"}));
  skews_.add(seconds_in(fields, {"skew-ns"}));
  return true;
}

std::string PipelineMetrics::text() const {
  std::map<std::string, std::map<std::string, double>> values;  // by element and field
  for (const ElementPtr& element : elements_of(pipeline_)) {
    const std::string type = type_of(element.get());
    if (!(type.starts_with("lf") || type.starts_with("rtplf")) || !has_property(element.get(), "stats")) continue;
    g_autoptr(GstStructure) stats = nullptr;
    g_object_get(element.get(), "stats", &stats, nullptr);
    if (!stats) continue;
    std::map<std::string, double>& of_type = values[type];
    for (const Row& row : kRows)
      if (type == row.element) {
        double& value = of_type[row.field];
        const auto count = static_cast<double>(count_in(stats, row.field));
        value = row.is_gauge ? std::max(value, count) : value + count;
      }
    if (type == "lfrtpgate")
      for (const char* reason : kGateReasons) of_type[reason] += static_cast<double>(count_in(stats, reason));
  }
  std::ostringstream out;
  out.precision(15);
  for (const Row& row : kRows)
    if (const auto found = values.find(row.element); found != values.end())
      out << head(row) << "lightfield_" << row.name << ' ' << found->second[row.field] * row.unit << '\n';
  if (const auto gates = values.find("lfrtpgate"); gates != values.end()) {
    out << head({"", "", "dropped_packets_total", "Packets that were dropped, by reason."});
    for (const char* reason : kGateReasons)
      out << "lightfield_dropped_packets_total{reason=\"" << reason << "\"} " << gates->second[reason] << '\n';
  }
  if (values.contains("lffragment"))
    out << answers_.text("lightfield_answer_seconds", "Time from a request to its answer.");
  if (values.contains("lfcompositor"))
    out << pictures_.text("lightfield_picture_latency_seconds", "Time from a request to its picture.")
        << skews_.text("lightfield_skew_seconds",
                       "Largest difference between captured and requested time in a picture.");
  return out.str() + cameras();
}

std::string PipelineMetrics::cameras() const {
  std::ostringstream up, ages, counts[std::size(kCameraRows)];
  size_t all = 0, working = 0;
  for (const ElementPtr& element : elements_of(pipeline_)) {
    if (type_of(element.get()) != "lfcamsrc") continue;
    guint id = 0;
    g_autoptr(GstStructure) stats = nullptr;
    g_object_get(element.get(), "camera", &id, "stats", &stats, nullptr);
    const bool works = g_strcmp0(gst_structure_get_string(stats, "state"), "lost") != 0;
    all++;
    working += works;
    const std::string label = "{camera=\"" + std::to_string(id) + "\"} ";
    up << "lightfield_camera_up" << label << works << '\n';
    for (size_t i = 0; i < std::size(kCameraRows); i++)
      counts[i] << "lightfield_" << kCameraRows[i].name << label << count_in(stats, kCameraRows[i].field) << '\n';
    const std::lock_guard lock(mutex_);
    const auto last = last_frames_.find(id);
    const int64_t time = last != last_frames_.end() ? last->second.load() : started_;
    ages << "lightfield_camera_frame_age_seconds" << label << static_cast<double>(g_get_monotonic_time() - time) * 1e-6
         << '\n';
  }
  if (all == 0) return "";
  std::ostringstream out;
  out << head({"", "", "cameras", "Cameras of this host.", true}) << "lightfield_cameras " << all << '\n'
      << head({"", "", "cameras_working", "Cameras that are not lost.", true}) << "lightfield_cameras_working "
      << working << '\n'
      << head({"", "", "camera_up", "1 if the camera is not lost.", true}) << up.str()
      << head({"", "", "camera_frame_age_seconds", "Time since the latest frame of the camera, or since the start.",
               true})
      << ages.str();
  for (size_t i = 0; i < std::size(kCameraRows); i++) out << head(kCameraRows[i]) << counts[i].str();
  return out.str();
}

namespace {

// Each input of an element leads to one of the results soon.
struct ProgressRow {
  const char* source;
  std::initializer_list<const char*> inputs;
  const char* element;
  std::initializer_list<const char*> results;
};
const ProgressRow kProgressRows[] = {
    {"lffragment", {"requests", "superseded"}, "lffragment", {"answers", "skipped", "refused", "bad-requests"}},
    {"rtplfdepay",
     {"bytes"},
     "lfcompositor",
     {"pictures", "skipped", "late-answers", "unexpected-answers", "repeated-answers", "bad-answers",
      "rig-mismatches"}},
};

// Returns nothing if there is no element of this type.
std::optional<uint64_t> sum_of(const std::vector<ElementPtr>& elements, const char* type,
                               std::initializer_list<const char*> fields) {
  std::optional<uint64_t> sum;
  for (const ElementPtr& element : elements) {
    if (type_of(element.get()) != type) continue;
    sum = sum.value_or(0);
    g_autoptr(GstStructure) stats = nullptr;
    g_object_get(element.get(), "stats", &stats, nullptr);
    for (const char* field : fields)
      if (stats) *sum += count_in(stats, field);
  }
  return sum;
}

}  // namespace

std::string ProgressCheck::problem() {
  const std::string stopped = stopped_element(), blocked = blocked_sink();
  return blocked.empty() ? stopped : blocked;
}

std::string ProgressCheck::stopped_element() {
  const std::vector<ElementPtr> elements = elements_of(pipeline_);
  std::string problem;
  for (size_t i = 0; i < std::size(kProgressRows); i++) {
    const ProgressRow& row = kProgressRows[i];
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
