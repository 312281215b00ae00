// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "base/error.h"
#include "rig/rig.h"

namespace lf {

// A file that a rig names and that is not there; the text names the file.
class MissingFile : public Error {
 public:
  using Error::Error;
};

// Where the frames of a camera come from.
struct CameraSource {
  enum class Kind {
    kScene,     // the built-in scene; no location
    kStill,     // one picture that is shown for ever
    kSequence,  // numbered pictures: `location` is a printf pattern with one %d, `first` the first number
    kMatroska,  // a Matroska file
    kDevice,    // a URI whose source gives pictures itself, of the sizes and rates it has (v4l2:///dev/video0)
    kBin,       // elements: `location` is a line as gst-launch-1.0 reads it, with one source pad left open
    kUri,       // anything else GStreamer plays: `location` is a URI
  };
  enum class Codec { kOther, kPng, kJpeg };  // how pictures of kStill and kSequence are coded

  Kind kind = Kind::kScene;
  Codec codec = Codec::kOther;
  std::string location;  // a local path but for kDevice, kBin and kUri
  int first = 0;
};

// The camera's `source` if the rig gives one, else its `image`, else the built-in scene. Looks at the first bytes of
// local files, not at their names. Throws MissingFile, and Error for a pattern that is not one.
CameraSource find_camera_source(const Rig& rig, const Camera& camera);

}  // namespace lf
