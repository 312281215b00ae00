// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "image/image.h"
#include "rig/rig.h"

namespace lf {

// What a camera shows of a patch: a small place of one colour (of a chart, or anywhere in the scene) that several
// cameras see. Its colour is not known, but the same for all that see it.
struct ColourSample {
  CameraIndex camera = 0;
  uint32_t patch = 0;
  Vec2 place{0, 0};              // middle of the patch in the camera's image, pixels
  Vec3 level{0, 0, 0};           // mean of the patch's pixels, 0..255
  std::array<bool, 3> usable{};  // channels in which the patch's pixels are not clipped
  double sigma = 1;              // standard deviation of the mean, levels
};

struct ColourSamples {
  size_t cameras = 0;  // cameras of the rig, of which not all need to have samples
  uint32_t patches = 0;
  // Patches of a chart in a row and in a column: patch p is the same as patch p + columns x rows, with the chart
  // elsewhere. 0: there is no chart, and no two patches are the same.
  int chart_columns = 0, chart_rows = 0;
  std::vector<ColourSample> all;
};

// The mean of an RGB image over the quadrilateral with these corners, in order around it; camera and patch are left
// for the caller. A channel is usable where at most 1 % of the pixels are at one of its ends (2 or less, 253 or more):
// the mean of others is not what the camera would have shown. Nothing where the quadrilateral has less than 9 pixels of
// the image, or ends outside of it.
std::optional<ColourSample> sample_quad(const Image& rgb, const std::array<Vec2, 4>& corners);

}  // namespace lf
