// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include <gst/gst.h>

#include "base/text.h"
#include "rig/source_security.h"
#include "serve/offer.h"

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

// Whether an encoder for the codec is installed: of those for H.264 that are known here the one of the highest rank is
// used, hardware or not.
bool can_encode(VideoCodec codec);

// A part of a launch line from raw video to RTP for webrtcbin: an encoder "encoder" that keeps no picture back, and a
// payloader "payloader" whose timestamps are 90,000 times the running time in seconds.
std::string encoder_line(const Offer& offer, int bits_per_second);
// Sets the bit rate of an encoder, while it runs.
void set_bit_rate(GstElement* encoder, int bits_per_second);

// Puts the RTP header extension kPlayoutDelayUri into all packets of the payloader, under the number that the offer has
// for it, 1..14.
void add_playout_delay(GstElement* payloader, guint id);

// Prepares the process for many viewers, who take more files than usual, and less memory. Call before threads are
// started.
void prepare_process();
// Prepares GStreamer for viewers: all elements must be installed, and a key for DTLS is made, which takes up to a
// second; the first viewer should not wait for it. Throws Error that names the package of what is missing.
void prepare_elements();

}  // namespace lf::serve
