// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include <gst/gst.h>

#include "base/text.h"
#include "rig/source_security.h"
#include "serve/offer.h"

namespace lf::serve {

// Creates a pipeline from a launch line, or with `as_bin` a bin that has ghost pads for all unlinked pads. The
// reference is floating. Throws Error that names a missing element.
inline GstElement* launch(const std::string& line, bool as_bin) {
  g_autoptr(GError) error = nullptr;
  GstElement* made =
      as_bin ? gst_parse_bin_from_description_full(line.c_str(), TRUE, nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error)
             : gst_parse_launch_full(line.c_str(), nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error);
  if (made && !error) return made;
  if (made) gst_object_unref(made);
  throw Error(error ? error->message : "the launch line has no elements");
}

inline std::string text_of(GstMessage* message) {
  g_autoptr(GError) error = nullptr;
  if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR)
    gst_message_parse_error(message, &error, nullptr);
  else
    gst_message_parse_warning(message, &error, nullptr);
  return std::string(GST_OBJECT_NAME(GST_MESSAGE_SRC(message))) + ": " + redacted_location(error ? error->message : "");
}

// True if an encoder for the codec is installed. For H.264, the installed encoder with the highest rank is used,
// hardware or software.
bool can_encode(VideoCodec codec);

// Returns the launch line of a low-latency encoder.
std::string encoder_line(VideoCodec codec, int bits_per_second, const std::string& name = "encoder");
// Returns the launch line of a payloader named "payloader", which turns encoded video into RTP for webrtcbin. RTP
// timestamps are 90,000 times the running time in seconds.
std::string payloader_line(const Offer& offer);
void set_bit_rate(GstElement* encoder, int bits_per_second);

void add_playout_delay(GstElement* payloader, guint id);

// Prepares the process for many viewers: raises the limit of open files and reduces memory fragmentation. Call this
// before threads are started.
void prepare_process();
// Checks that all required elements are installed, and creates the DTLS key in advance, because this takes up to a
// second. Throws Error that names the package of a missing element.
void prepare_elements();

}  // namespace lf::serve
