// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <vector>

#include "rig/rig.h"
#include "rig/rig_report.h"
#include "rig/still_image_cache.h"

namespace lf {

// Tests whether the geometry of a rig fits the images of its cameras. Finds files in the wrong order, inverted
// extrinsics and wrong axes conventions, which are valid rigs but show every object several times.
//
// Corners of neighbouring images are matched by normalised cross-correlation, without the geometry (Zhang et al., "A
// robust technique for matching two uncalibrated images", 1995). A match fits the geometry if it lies near the epipolar
// line of its corner, on the part of that line that belongs to points in front of the camera.

// The matches between the images of two neighbouring cameras. Matches of very distant points are not counted, because
// such points are at the same place in both images for any positions of the cameras.
struct EpipolarPair {
  enum class Verdict {
    kUnknown,      // too few matches, or the matches disagree
    kFits,         // most matches fit the geometry
    kContradicts,  // most matches contradict the geometry
  };
  CameraIndex a = 0, b = 0;
  size_t corners = 0;                     // in the image with fewer corners
  size_t fitting = 0, contradicting = 0;  // numbers of matches
  Verdict verdict() const;
};

struct EpipolarCheck {
  std::vector<EpipolarPair> pairs;
  // Cameras that explain all contradictions, because the pairs without these cameras fit. Ascending.
  std::vector<CameraIndex> misplaced;
  bool has_contradiction = false;  // the geometry contradicts the images, and `misplaced` does not explain why

  size_t count(EpipolarPair::Verdict verdict) const;
};

// Compares up to `max_pairs` edges of the camera mesh. The choice is always the same, and includes as many cameras as
// possible. A few more pairs are compared to find misplaced cameras. `images` returns the RGB image of a camera, in the
// rig's size. It is called once for each camera in the pairs. If `images` throws Error, the camera is left out.
//
// The images need texture and an overlap, and must show the same side of objects the same way up. Otherwise there are
// no matches, and the verdict is unknown. Parallel cameras in one row hide some faults, for example a rotation of all
// cameras by 180 degrees around the row.
//
// Cost: about 4 ms for each camera of 320x240 pixels, plus decoding, and 4 ms for each pair. Large images are reduced
// before the search. Needs about 0.2 MB for each camera.
inline constexpr size_t kMaxEpipolarPairs = 192;
EpipolarCheck check_epipolar_geometry(const Rig& rig, const CameraImages& images, size_t max_pairs = kMaxEpipolarPairs);

// Returns warnings about contradictions, for people. Empty if there is no contradiction.
std::vector<RigFinding> describe(const EpipolarCheck& check);

}  // namespace lf
