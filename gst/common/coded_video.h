// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

namespace lf {

// A kind of video whose frames are coded by what changes from one to the next, and that Matroska files take.
struct CodedVideo {
  const char* name;    // of its caps
  const char* parser;  // the element that brings it into the form of such files; null: it has no other
  const char* muxed;   // caps of that form
};

// Null for video of other kinds (JPEG and raw video among them), of which not all of a frame is in each buffer, or
// whose parser is not installed.
const CodedVideo* find_coded_video(const GstCaps* caps);

}  // namespace lf
