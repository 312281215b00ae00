// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/check/gstharness.h>
#include <gst/gst.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

// What the tests of the elements share. gst_test.cc holds their main(): it lets GStreamer see the plugin of this build
// and those of the system, and makes every GLib critical end the program.
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

// Takes the bytes along.
GstBuffer* to_buffer(const std::vector<uint8_t>& bytes);
std::vector<uint8_t> to_bytes(GstBuffer* buffer);

// A pipeline from a launch line; a broken line fails the test and gives null.
ElementPtr launch(const std::string& line);
// Plays until the end of the stream and sets it to NULL: "" or the error's message and debug text ("timeout" after
// `seconds`).
std::string run(GstElement* pipeline, double seconds = 20);
// The same of a launch line.
std::string run(const std::string& line, double seconds = 20);

// The caps of a pad as text; "" if it has none.
std::string caps_of(GstPad* pad);

// A uint64 field of an element's `stats` structure; fails the test where there is none.
uint64_t stat(GstElement* element, const char* field);

// The texts of the warnings that wait on a bus; they wait no more. warnings_on() has them one behind the other.
std::vector<std::string> all_warnings_on(GstBus* bus);
std::string warnings_on(GstBus* bus);

// Whether EOS is among the events that come out of an element.
bool comes_to_end(GstHarness* harness);

// A file that is gone with the object.
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
