// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rig/rig_report.h"

namespace lf {

struct FilmLength {
  size_t frames = 0;
  double seconds = 0;       // 0: the file has no timestamps
  bool is_cut_off = false;  // the file ends inside an element
};

// Returns the length of the first video track of a Matroska or WebM file; nullopt if the file has no video frames or
// can't be read. Reads the headers of all frames, but not the frames. Never throws on damaged files.
std::optional<FilmLength> matroska_length(const std::string& path);

// A film with its place in the rig file, for messages.
struct Film {
  std::string place;  // "cameras[3].source: /films/cam_3.mkv"
  FilmLength length;
};
// Returns a warning for each film that is cut off or has another length than most films. If several films differ, up to
// two frames or 1 % are tolerated, because recordings of cameras that are not synchronised differ by so much. If only a
// single film differs, a difference of one frame is already reported.
std::vector<RigFinding> compare_film_lengths(const std::vector<Film>& films);

}  // namespace lf
