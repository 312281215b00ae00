// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

namespace lf {

// Inter-coded video that Matroska can store.
struct CodedVideo {
  const char* name;    // media type
  const char* parser;  // element that converts to the form in Matroska; null: not needed
  const char* muxed;   // caps in Matroska
};

// Returns null for other video, such as JPEG and raw video. Also null if buffers may hold partial frames or the parser
// is not installed.
const CodedVideo* find_coded_video(const GstCaps* caps);

}  // namespace lf
