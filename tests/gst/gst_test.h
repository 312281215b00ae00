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
using CapsPtr = std::unique_ptr<GstCaps, Unref<gst_caps_unref>>;
using ElementPtr = std::unique_ptr<GstElement, Unref<gst_object_unref>>;
using HarnessPtr = std::unique_ptr<GstHarness, Unref<gst_harness_teardown>>;
using StructurePtr = std::unique_ptr<GstStructure, Unref<gst_structure_free>>;

GstBuffer* to_buffer(const std::vector<uint8_t>& bytes);
std::vector<uint8_t> to_bytes(GstBuffer* buffer);

// Returns the pipeline of a launch line. An invalid line fails the test and returns null.
ElementPtr launch(const std::string& line);
// Plays until EOS and sets the pipeline to NULL. Returns "", the error's message and debug text, or "timeout" after
// `seconds`.
std::string run(GstElement* pipeline, double seconds = 20);
std::string run(const std::string& line, double seconds = 20);

// Returns the caps of a pad as text; "" if it has none.
std::string caps_of(GstPad* pad);

// Returns a uint64 field of an element's `stats` structure. A missing field fails the test.
uint64_t stat(GstElement* element, const char* field);

// Pops all warnings from a bus and returns their texts; warnings_on() concatenates the texts.
std::vector<std::string> all_warnings_on(GstBus* bus);
std::string warnings_on(GstBus* bus);

bool reaches_eos(GstHarness* harness);

class TempFile {
 public:
  explicit TempFile(const std::vector<uint8_t>& bytes, const std::string& ending = "");
  ~TempFile();
  TempFile(const TempFile&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

}  // namespace lf::test
