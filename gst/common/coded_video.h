// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

namespace lf {

// A codec with inter-coded pictures that Matroska can store.
struct CodedVideo {
  const char* name;
  const char* parser;  // parser that converts the stream to the form in Matroska; null if none is needed
  const char* muxed;
};

// Returns null for other video, such as JPEG and raw video, if buffers may hold partial frames, and if the parser is
// not installed.
const CodedVideo* find_coded_video(const GstCaps* caps);

}  // namespace lf
