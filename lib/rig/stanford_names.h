// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "rig/exchange.h"

namespace lf {

// The Stanford light field archive (http://lightfield.stanford.edu): rectified images whose names say where they were
// taken, out_ROW_COLUMN_Y_X_.png, such as out_00_01_-381.909271_1038.347534_.png: y downwards, x to the right, in units
// that the archive leaves open. All cameras look the same way, and a point at the focus distance is at the same pixel
// in all images: the lens moves with the camera.

struct StanfordOptions {
  double f = 0;               // pixels; the names do not tell
  double focus_distance = 0;  // metres; 0: far away, where points stand still in unshifted images
  double unit = 1e-3;         // metres
};

// All files in `directory` with such names, row by row; a grid where no place is empty. The axis of the middle of the
// array goes through the middle of the images. Throws Error naming the file or the option.
RigImport import_stanford(const std::string& directory, const StanfordOptions& options);

// Copies the images under such names into `directory`, which is made where it is missing. The rig must be a grid of
// cameras in one plane that look at right angles to it with one focal length and without distortion, their principal
// points shifted for one focus distance; up to a turn of the whole: otherwise Error says by how many pixels it differs.
// The notes have the options that bring it back.
RigExport export_stanford(const Rig& rig, const std::string& directory, double unit = StanfordOptions().unit);

}  // namespace lf
