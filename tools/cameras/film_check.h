// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rig/film_length.h"
#include "rig/rig.h"

namespace lf::cameras {

// Measures the length of the first video stream of a file: reads the whole file with GStreamer, without decoding.
// `timed` is true for a file with timestamps, and false for a series of JPEG images. Returns nullopt if GStreamer finds
// no frames. The result has zero frames if the file needs an element that is not allowed (rig/source_security.h).
std::optional<FilmLength> demuxed_length(const std::string& path, bool timed);

// Returns an error for each still that the elements cannot decode, although other programs may.
std::vector<RigFinding> check_still_decoders(const Rig& rig);

// Returns a warning for each film of the rig that has no frames, is cut off, or has another length than most films.
// Films in other formats than Matroska are read completely; such films of more than 1 GiB are not checked.
std::vector<RigFinding> check_films(const Rig& rig);

}  // namespace lf::cameras
