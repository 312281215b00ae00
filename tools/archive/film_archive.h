// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "rig/rig.h"

namespace lf::archive {

// What became of the film of a camera.
struct ArchivedFilm {
  uint64_t frames = 0;                         // of the archived film
  uint64_t unreadable = 0;                     // frames of the film that no decoder takes: they are left out
  uint64_t bytes_before = 0, bytes_after = 0;  // of the files
  bool is_copy = false;                        // the film was no Motion JPEG, and stays as it is
  double squares = 0;   // sum of squared differences of luma between the film's pictures and the archived ones
  uint64_t pixels = 0;  // of all pictures together; 0 of a copy

  // Of luma, dB; infinite where nothing differs.
  double psnr() const;
};

// Keeps a camera's Matroska film, as a recording has it, in the file `out`: Motion JPEG becomes H.264 of constant quality
// (`quantizer`, x264's: 1 the best, 51 the worst), a key frame at least each second; each frame keeps its time, and
// the film its end and its beginning's time of day. Film of another kind is copied as it is.
//
// Reads both files again afterwards and compares their pictures one by one. `told` is called with how much is done
// (0 to 1), in the thread that calls this. gst_init() must have been called. Throws Error that names the file: one that
// can't be read or written, an element that is not installed, a picture that is missing in `out` or has another time.
ArchivedFilm archive_film(const Camera& camera, const std::string& film, const std::string& out, int quantizer,
                          const std::function<void(double)>& told);

}  // namespace lf::archive
