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

ElementPtr launch(const std::string& line) {
  GError* error = nullptr;
  GstElement* pipeline = gst_parse_launch_full(line.c_str(), nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error);
  if (error) ADD_FAILURE() << line << ": " << error->message;
  g_clear_error(&error);
  return ElementPtr(pipeline);
}

std::string run(GstElement* pipeline, double seconds) {
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  GstBus* bus = gst_element_get_bus(pipeline);
  GstMessage* message = gst_bus_timed_pop_filtered(bus, static_cast<GstClockTime>(seconds * GST_SECOND),
                                                   static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR));
  std::string result;
  if (!message) {
    result = "timeout";
  } else if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR) {
    GError* error = nullptr;
    gchar* debug = nullptr;
    gst_message_parse_error(message, &error, &debug);
    result = std::string(error->message) + " (" + (debug ? debug : "") + ")";
    g_clear_error(&error);
    g_free(debug);
  }
  if (message) gst_message_unref(message);
  gst_object_unref(bus);
  gst_element_set_state(pipeline, GST_STATE_NULL);
  return result;
}

std::string run(const std::string& line, double seconds) {
  const ElementPtr pipeline = launch(line);
  return pipeline ? run(pipeline.get(), seconds) : "no pipeline";
}

std::string caps_of(GstPad* pad) {
  const CapsPtr caps(gst_pad_get_current_caps(pad));
  if (!caps) return "";
  gchar* text = gst_caps_to_string(caps.get());
  const std::string out = text;
  g_free(text);
  return out;
}

uint64_t stat(GstElement* element, const char* field) {
  GstStructure* stats = nullptr;
  g_object_get(element, "stats", &stats, nullptr);
  const StructurePtr owner(stats);
  guint64 value = 0;
  if (!stats || !gst_structure_get_uint64(stats, field, &value)) ADD_FAILURE() << "stats have no " << field;
  return value;
}

std::vector<std::string> all_warnings_on(GstBus* bus) {
  std::vector<std::string> texts;
  while (g_autoptr(GstMessage) message = gst_bus_pop_filtered(bus, GST_MESSAGE_WARNING)) {
    g_autoptr(GError) error = nullptr;
    gst_message_parse_warning(message, &error, nullptr);
    texts.emplace_back(error->message);
  }
  return texts;
}

std::string warnings_on(GstBus* bus) {
  std::string all;
  for (const std::string& text : all_warnings_on(bus)) all += text;
  return all;
}

bool reaches_eos(GstHarness* harness) {
  bool ended = false;
  while (!ended) {
    GstEvent* event = gst_harness_pull_event(harness);  // times out after a minute
    if (!event) break;
    ended = GST_EVENT_TYPE(event) == GST_EVENT_EOS;
    gst_event_unref(event);
  }
  return ended;
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
