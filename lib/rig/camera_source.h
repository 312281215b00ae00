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

class MissingFile : public Error {
 public:
  using Error::Error;
};

// The origin of a camera's images, as found from the texts in the rig file.
struct CameraSource {
  enum class Kind {
    kScene,       // the built-in scene; `location` is empty
    kStill,       // a single image, shown forever
    kSequence,    // numbered image files; `location` is a printf pattern with one %d
    kJpegStream,  // one file of concatenated JPEG images
    kMatroska,
    kFile,
    kUri,     // `location` is a URI other than a file
    kDevice,  // a URI of a capture device, which offers specific sizes and rates (v4l2:///dev/video0)
    kBin,     // GStreamer elements; `location` is a gst-launch-1.0 line with one unlinked source pad
  };
  enum class Codec { kOther, kPng, kJpeg };

  Kind kind = Kind::kScene;
  Codec codec = Codec::kOther;
  std::string location;      // a local path, except for kUri, kDevice and kBin
  int first = 0, count = 0;  // kSequence only: first number, and number of images
  bool is_file() const { return kind >= Kind::kStill && kind <= Kind::kFile; }
};

// Returns the path of the image with this index (0 to count - 1) in a sequence.
std::string sequence_file(const CameraSource& sequence, int index);

// Finds out what a camera's images come from: its `source`, otherwise its `image`, otherwise the built-in scene. The
// player, the tools and `lf-rig check` all use this function.
//
// If a file with the name exists, it takes precedence over a URI, a pattern or elements with the same text; its first
// bytes determine its kind. Every URI that is not a file gives kUri. Throws MissingFile for a missing file or a gap in
// a sequence, and Error for a malformed pattern.
CameraSource find_camera_source(const Rig& rig, const Camera& camera);

// The same for the value of one `image` or `source`. `text` must not be empty.
CameraSource find_source(const Rig& rig, const std::string& text, bool is_image);

// Returns true if no camera names an image or a source, so that all cameras show the built-in scene.
bool has_no_pictures(const Rig& rig);

// The colour corrections of a rig's cameras. They are computed on first use. Thread-safe.
class RigColourCorrections {
 public:
  // Copies the data; `rig` need not outlive this object.
  explicit RigColourCorrections(const Rig& rig);

  bool any() const { return !cameras_.empty(); }
  // Returns the correction; null if the camera has none. `family` must not be kNone. Valid during the lifetime of this
  // object.
  const ColourCorrection* of(CameraIndex camera, PixelFamily family) const;

 private:
  struct CameraEntry {
    ColourModel model;
    int width, height;
    Vec2 centre;
    std::once_flag made[2];
    std::unique_ptr<const ColourCorrection> correction[2];
  };
  // null for a camera without a correction; empty if no camera has a correction
  std::vector<std::unique_ptr<CameraEntry>> cameras_;
};

}  // namespace lf
