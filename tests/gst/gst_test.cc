// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/gst_test.h"

#include "support/select_files.h"

namespace lf::test {

GstBuffer* to_buffer(const std::vector<uint8_t>& bytes) { return gst_buffer_new_memdup(bytes.data(), bytes.size()); }

std::vector<uint8_t> to_bytes(GstBuffer* buffer) {
  std::vector<uint8_t> bytes(gst_buffer_get_size(buffer));
  gst_buffer_extract(buffer, 0, bytes.data(), bytes.size());
  return bytes;
}

ElementPtr make_element(const char* factory) {
  return ElementPtr(GST_ELEMENT(gst_object_ref_sink(gst_element_factory_make(factory, nullptr))));
}

ElementPtr child_of(GstElement* bin, const std::string& name) {
  return ElementPtr(gst_bin_get_by_name(GST_BIN(bin), name.c_str()));
}

PadPtr pad_of(GstElement* element, const char* name) { return PadPtr(gst_element_get_static_pad(element, name)); }

void on_buffers(GstElement* element, const char* pad, std::function<void(GstBuffer*)> see) {
  using See = std::function<void(GstBuffer*)>;
  const auto probe = [](GstPad*, GstPadProbeInfo* info, gpointer data) {
    (*static_cast<See*>(data))(GST_PAD_PROBE_INFO_BUFFER(info));
    return GST_PAD_PROBE_OK;
  };
  gst_pad_add_probe(pad_of(element, pad).get(), GST_PAD_PROBE_TYPE_BUFFER, probe, new See(std::move(see)),
                    [](gpointer data) { delete static_cast<See*>(data); });
}

PipelinePtr launch(const std::string& line) {
  g_autoptr(GError) error = nullptr;
  PipelinePtr pipeline(gst_parse_launch_full(line.c_str(), nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error));
  if (!pipeline) throw std::runtime_error(line + ": " + error->message);
  return pipeline;
}

std::string run(GstElement* pipeline, double seconds) {
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  g_autoptr(GstBus) bus = gst_element_get_bus(pipeline);
  const MessagePtr message(gst_bus_timed_pop_filtered(bus, static_cast<GstClockTime>(seconds * GST_SECOND),
                                                      GstMessageType(GST_MESSAGE_EOS | GST_MESSAGE_ERROR)));
  std::string result = message ? "" : "timeout";
  if (message && GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_ERROR) {
    g_autoptr(GError) error = nullptr;
    g_autofree gchar* debug = nullptr;
    gst_message_parse_error(message.get(), &error, &debug);
    result = std::string(error->message) + " (" + (debug ? debug : "") + ")";
  }
  gst_element_set_state(pipeline, GST_STATE_NULL);
  return result;
}

std::string run(const std::string& line, double seconds) { return run(launch(line).get(), seconds); }

std::string caps_of(GstPad* pad) {
  const CapsPtr caps(gst_pad_get_current_caps(pad));
  if (!caps) return "";
  g_autofree gchar* text = gst_caps_to_string(caps.get());
  return text;
}

uint64_t stat(GstElement* element, const char* field) {
  const StructurePtr stats = stats_of(element);
  guint64 value = 0;
  if (!stats || !gst_structure_get_uint64(stats.get(), field, &value)) ADD_FAILURE() << "stats have no " << field;
  return value;
}

std::string text_of(GstMessage* message) {
  g_autoptr(GError) error = nullptr;
  const bool warns = GST_MESSAGE_TYPE(message) == GST_MESSAGE_WARNING;
  (warns ? gst_message_parse_warning : gst_message_parse_error)(message, &error, nullptr);
  return error->message;
}

std::vector<std::string> texts_on(GstBus* bus, GstMessageType type) {
  std::vector<std::string> texts;
  while (const MessagePtr message{gst_bus_pop_filtered(bus, type)}) texts.push_back(text_of(message.get()));
  return texts;
}

std::vector<std::string> all_warnings_on(GstBus* bus) { return texts_on(bus, GST_MESSAGE_WARNING); }

std::string warnings_on(GstBus* bus) {
  std::string all;
  for (const std::string& text : all_warnings_on(bus)) all += text;
  return all;
}

std::string warnings_of(GstElement* pipeline) {
  g_autoptr(GstBus) bus = gst_element_get_bus(pipeline);
  return warnings_on(bus);
}

bool reaches_eos(GstHarness* harness) {
  while (const EventPtr event{gst_harness_pull_event(harness)})  // times out after a minute
    if (GST_EVENT_TYPE(event.get()) == GST_EVENT_EOS) return true;
  return false;
}

void push_segment(GstHarness* harness) {
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  gst_harness_push_event(harness, gst_event_new_segment(&segment));
}

void flush(GstHarness* harness) {
  gst_harness_push_event(harness, gst_event_new_flush_start());
  gst_harness_push_event(harness, gst_event_new_flush_stop(TRUE));
  push_segment(harness);
}

TempFile::TempFile(const std::vector<uint8_t>& bytes, const std::string& ending) {
  std::string name = (std::filesystem::temp_directory_path() / "lf-test-XXXXXX").string() + ending;
  const int file = mkstemps(name.data(), static_cast<int>(ending.size()));
  if (file < 0) throw std::runtime_error("no temporary file");
  close(file);
  path_ = name;
  std::ofstream(path_, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

TempFile::~TempFile() {
  std::error_code ignored;
  std::filesystem::remove(path_, ignored);
}

}  // namespace lf::test

namespace {

// Criticals that other libraries cause on their own.
constexpr const char* kAllowed[] = {
    // rtspsrc loses its segment's sequence number if it stops while its jitter buffer adds a pad (1.22).
    "gst_event_set_seqnum: assertion 'seqnum != GST_SEQNUM_INVALID' failed",
};

void end_at_criticals(const gchar* domain, GLogLevelFlags level, const gchar* message, gpointer) {
  g_log_default_handler(domain, level, message, nullptr);
  const auto is_message = [message](const char* allowed) { return g_str_equal(message, allowed); };
  if ((level & G_LOG_LEVEL_CRITICAL) && std::ranges::none_of(kAllowed, is_message)) G_BREAKPOINT();
}

}  // namespace

int main(int argc, char** argv) {
  // Tests neither use nor change the user's registry.
  g_setenv("GST_PLUGIN_PATH", LF_PLUGIN_DIR, TRUE);
  g_setenv("GST_REGISTRY", LF_PLUGIN_DIR "/test-registry.bin", TRUE);
  testing::InitGoogleTest(&argc, argv);
  gst_init(&argc, &argv);
  if (!lf::test::select_files(argc, argv)) return 2;
  g_log_set_default_handler(end_at_criticals, nullptr);
  const int result = RUN_ALL_TESTS();
  gst_deinit();  // triggers the report of the leaks tracer
  return result;
}
