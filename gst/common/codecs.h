// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include <gst/gst.h>

namespace lf {

// A video codec that a recording stores without transcoding: its pictures depend on each other (such as H.264), and
// Matroska can contain the stream.
struct CodedVideo {
  const char* name;
  const char* parser;  // parser element that makes the form `muxed`; null if none is needed
  const char* muxed;
};

// Returns the codec of a stream with these caps. Returns null for all other video, such as JPEG and raw video, for
// streams with incomplete frames per buffer (alignment=nal), and if the parser is not installed.
const CodedVideo* find_coded_video(const GstCaps* caps);

// Checks whether GStreamer can decode a still image in a format other than PNG and JPEG. Returns "" if a decoder is
// installed, and otherwise the reason for the user, for example that the file is not an image or needs a TIFF decoder.
// `lf-rig check` and lfcamsrc both use this function, so their results agree. Call gst_init() first.
std::string still_decoding_problem(const std::string& path);

}  // namespace lf
