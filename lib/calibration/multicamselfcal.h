// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>

#include "calibration/tracks.h"
#include "rig/rig.h"

namespace lf {

// What MultiCamSelfCal (Svoboda, Martinec, Pajdla 2005) reads, in one folder: points.dat (3 rows a camera: u, v, 1; a
// column a position), IdMat.dat (a row a camera: seen or not), Res.dat (a row a camera: width, height) and, where
// lenses are known, *.rad (K11 ... K33, kc1 ... kc4), one a camera in the order of their names. `first_pixel`: the
// centre of the top-left pixel is at (0, 0) in the files of programs that count from 0, and at (1, 1) in Matlab's own.
struct MultiCamSelfCal {
  Tracks tracks;              // cameras have ids from 0
  std::optional<Rig> lenses;  // all poses the same
};
// Throws Error naming the file and the row.
MultiCamSelfCal load_multicamselfcal(const std::string& directory, double first_pixel);

}  // namespace lf
