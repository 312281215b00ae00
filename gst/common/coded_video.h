// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

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

}  // namespace lf
