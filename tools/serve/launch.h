// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <functional>
#include <string>

#include "base/error.h"
#include "rig/location_text.h"

namespace lf::serve {

// A pipeline from a launch line; owned by the caller. Throws Error that names what is not installed.
inline GstElement* launch_pipeline(const std::string& line) {
  GError* error = nullptr;
  GstElement* pipeline = gst_parse_launch_full(line.c_str(), nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error);
  if (pipeline && !error) return GST_ELEMENT(gst_object_ref_sink(pipeline));
  const std::string text = error ? error->message : "no pipeline";
  g_clear_error(&error);
  if (pipeline) gst_object_unref(pipeline);
  throw Error(text);
}

// A bin with a pad for what the line leaves open; floating. Throws Error that names what is not installed.
inline GstElement* launch_bin(const std::string& line) {
  GError* error = nullptr;
  GstElement* bin =
      gst_parse_bin_from_description_full(line.c_str(), TRUE, nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error);
  if (bin && !error) return bin;
  const std::string text = error ? error->message : "nothing in it";
  g_clear_error(&error);
  if (bin) gst_object_unref(bin);
  throw Error(text);
}

// Sets properties of the element of this name inside a bin, as g_object_set() does.
template <typename... Args>
void set_in(GstElement* bin, const char* name, Args... args) {
  GstElement* element = gst_bin_get_by_name(GST_BIN(bin), name);
  g_object_set(element, args..., nullptr);
  gst_object_unref(element);
}

// The text of an error or a warning: which element says what.
inline std::string text_of(GstMessage* message) {
  GError* error = nullptr;
  if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR)
    gst_message_parse_error(message, &error, nullptr);
  else
    gst_message_parse_warning(message, &error, nullptr);
  std::string text = std::string(GST_OBJECT_NAME(GST_MESSAGE_SRC(message))) + ": " + location_text(error ? error->message : "");
  g_clear_error(&error);
  return text;
}

// Runs the job in the main loop, soon, and never inside of this call. Any thread.
inline void on_main_thread(std::function<void()> job) {
  GSource* source = g_idle_source_new();
  g_source_set_priority(source, G_PRIORITY_DEFAULT);
  g_source_set_callback(
      source,
      [](gpointer data) -> gboolean {
        (*static_cast<std::function<void()>*>(data))();
        return G_SOURCE_REMOVE;
      },
      new std::function<void()>(std::move(job)),
      [](gpointer data) { delete static_cast<std::function<void()>*>(data); });
  g_source_attach(source, nullptr);
  g_source_unref(source);
}

}  // namespace lf::serve
