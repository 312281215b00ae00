// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/check/gstharness.h>
#include <gst/gst.h>

#include "support/test.h"

// Shared helpers of the element tests. main() in gst_test.cc restricts GStreamer to the plugin of this build and the
// system plugins, and makes every GLib critical fatal.
namespace lf::test {

template <auto unref>
struct Unref {
  template <typename T>
  void operator()(T* object) const {
    unref(object);
  }
};
using BufferPtr = std::unique_ptr<GstBuffer, Unref<gst_buffer_unref>>;
using BusPtr = std::unique_ptr<GstBus, Unref<gst_object_unref>>;
using CapsPtr = std::unique_ptr<GstCaps, Unref<gst_caps_unref>>;
using ElementPtr = std::unique_ptr<GstElement, Unref<gst_object_unref>>;
using EventPtr = std::unique_ptr<GstEvent, Unref<gst_event_unref>>;
using HarnessPtr = std::unique_ptr<GstHarness, Unref<gst_harness_teardown>>;
using MessagePtr = std::unique_ptr<GstMessage, Unref<gst_message_unref>>;
using PadPtr = std::unique_ptr<GstPad, Unref<gst_object_unref>>;
using StructurePtr = std::unique_ptr<GstStructure, Unref<gst_structure_free>>;
inline void stop_and_unref(GstElement* pipeline) {
  gst_element_set_state(pipeline, GST_STATE_NULL);
  gst_object_unref(pipeline);
}
using PipelinePtr = std::unique_ptr<GstElement, Unref<stop_and_unref>>;

GstBuffer* to_buffer(const std::vector<uint8_t>& bytes);
std::vector<uint8_t> to_bytes(GstBuffer* buffer);

ElementPtr make_element(const char* factory);
// Returns null if the bin has no element with this name.
ElementPtr child_of(GstElement* bin, const std::string& name);
PadPtr pad_of(GstElement* element, const char* name);
// Calls `see` with each buffer that passes the pad, in the thread of the stream.
void on_buffers(GstElement* element, const char* pad, std::function<void(GstBuffer*)> see);

// Returns the pipeline of a launch line. Throws std::runtime_error for an invalid line.
PipelinePtr launch(const std::string& line);
// Plays until EOS and sets the pipeline to NULL. Returns "", the error's message and debug text, or "timeout" after
// `seconds`.
std::string run(GstElement* pipeline, double seconds = 20);
std::string run(const std::string& line, double seconds = 20);

// Returns the caps of a pad as text; "" if it has none.
std::string caps_of(GstPad* pad);

template <typename T>
T get(void* object, const char* property) {
  T value{};
  g_object_get(object, property, &value, nullptr);
  return value;
}
template <>
inline std::string get(void* object, const char* property) {
  g_autofree gchar* text = get<gchar*>(object, property);
  return text ? text : "";
}
// Emits an action signal and returns its result.
template <typename... Args>
bool emit(void* object, const char* signal, Args... args) {
  gboolean done = FALSE;
  g_signal_emit_by_name(object, signal, args..., &done);
  return done;
}
inline StructurePtr stats_of(void* element) { return StructurePtr(get<GstStructure*>(element, "stats")); }
// Returns a uint64 field of an element's `stats` structure. A missing field fails the test.
uint64_t stat(GstElement* element, const char* field);

// Returns the text of an error or warning.
std::string text_of(GstMessage* message);
// Pops all messages of a type from a bus, or from the bus of a pipeline, and returns their texts.
std::vector<std::string> texts_on(GstBus* bus, GstMessageType type);
std::vector<std::string> all_warnings_on(GstBus* bus);
// Returns all warnings in one text.
std::string warnings_on(GstBus* bus);
std::string warnings_of(GstElement* pipeline);

// The bus of an element that is in no pipeline.
class ElementBus {
 public:
  explicit ElementBus(GstElement* element) : element_(element), bus_(gst_bus_new()) {
    gst_element_set_bus(element, bus_.get());
  }
  ~ElementBus() { gst_element_set_bus(element_, nullptr); }
  ElementBus(const ElementBus&) = delete;
  GstBus* get() const { return bus_.get(); }
  std::string warnings() const { return warnings_on(get()); }
  std::vector<std::string> errors() const { return texts_on(get(), GST_MESSAGE_ERROR); }

 private:
  GstElement* element_;
  BusPtr bus_;
};

bool reaches_eos(GstHarness* harness);
// Pushes the start of a new stream.
void push_segment(GstHarness* harness);
// Pushes a flush and the segment after it.
void flush(GstHarness* harness);

// A file that only its owner can read.
class TempFile {
 public:
  explicit TempFile(const std::vector<uint8_t>& bytes, const std::string& ending = "");
  explicit TempFile(const std::string& text, const std::string& ending = "")
      : TempFile(std::vector<uint8_t>(text.begin(), text.end()), ending) {}
  ~TempFile();
  TempFile(const TempFile&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

}  // namespace lf::test
