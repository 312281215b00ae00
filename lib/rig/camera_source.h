// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "base/text.h"
#include "image/colour_correction.h"
#include "image/image.h"
#include "rig/rig.h"

namespace lf {

// A file that a rig names and that is missing; the text names the file.
class MissingFile : public Error {
 public:
  using Error::Error;
};

// A camera's source of frames.
struct CameraSource {
  enum class Kind {
    kScene,       // the built-in scene; no location
    kStill,       // one picture that is shown for ever
    kSequence,    // numbered pictures: `location` is a printf pattern with one %d
    kJpegStream,  // one file of JPEG pictures, one behind another
    kMatroska,    // a Matroska file
    kFile,        // any other file
    kUri,         // `location` is a URI that is no file
    kDevice,      // a URI whose source element outputs pictures of certain sizes and rates (v4l2:///dev/video0)
    kBin,         // elements: `location` is a line as gst-launch-1.0 reads it, with one source pad left open
  };
  enum class Codec { kOther, kPng, kJpeg };  // format of pictures; kStill and kSequence only

  Kind kind = Kind::kScene;
  Codec codec = Codec::kOther;
  std::string location;      // a local path, except for kUri, kDevice and kBin
  int first = 0, count = 0;  // kSequence: first number, number of pictures
  bool is_file() const { return kind >= Kind::kStill && kind <= Kind::kFile; }
};

// The path of picture `index` (0, 1, ...) of a sequence.
std::string sequence_file(const CameraSource& sequence, int index);

// Resolves the camera's `source`, or else its `image`, or else the built-in scene. The player, the tools and
// `lf-rig check` all use this function. The first bytes of a file decide its kind. An existing file always counts as
// that file, whatever its name looks like: a URI, a pattern or elements. Returns kUri for every URI that is no file.
// Throws MissingFile for a missing file or a gap in a sequence, and Error for a malformed pattern.
CameraSource find_camera_source(const Rig& rig, const Camera& camera);

// The same for one of the two; `text` is not empty.
CameraSource find_source(const Rig& rig, const std::string& text, bool is_image);

// The corrections of a rig's cameras, each made when it is first asked for. For any number of threads.
class CameraColours {
 public:
  // Takes what it needs from the rig, which may go.
  explicit CameraColours(const Rig& rig);

  // Whether any camera's colours are corrected.
  bool any() const { return !cameras_.empty(); }
  // Null for a camera whose colours are taken as they come. `family`: not kNone. Valid as long as this is.
  const ColourCorrection* of(CameraIndex camera, PixelFamily family) const;

 private:
  struct OfCamera {
    ColourModel model;
    int width, height;
    Vec2 centre;
    std::once_flag made[2];  // set once the correction for a family is made
    std::unique_ptr<const ColourCorrection> correction[2];
  };
  std::vector<std::unique_ptr<OfCamera>> cameras_;  // null without colour; empty where none has one
};

}  // namespace lf
