// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "image/image.h"
#include "rig/rig.h"

namespace lf {

// The measured colour of a patch in one camera. A patch is a small area of uniform colour, on a chart or in the scene.
// Its true colour is unknown, but the same for all cameras.
struct ColourSample {
  CameraIndex camera = 0;
  uint32_t patch = 0;
  Vec2 place{0, 0};              // centre of the patch, pixels
  Vec3 level{0, 0, 0};           // mean of the patch's pixels, 0 to 255
  std::array<bool, 3> usable{};  // channels without clipped pixels
  double sigma = 1;              // standard deviation of the mean, in levels
};

struct ColourSamples {
  size_t cameras = 0;
  uint32_t patches = 0;
  // Columns and rows of the chart, or 0 without a chart. If the samples come from a chart, patch p and patch p +
  // columns x rows are the same patch at different positions of the chart. Without a chart, all patches are different.
  int chart_columns = 0, chart_rows = 0;
  std::vector<ColourSample> all;
};

// Returns the mean colour inside a quadrilateral of an RGB image; `corners` are in order around its border. The caller
// sets camera and patch. A channel is usable if at most 1 % of its pixels are clipped (2 or less, 253 or more), because
// clipping biases the mean. Returns nullopt if the quadrilateral covers fewer than 9 pixels or leaves the image.
std::optional<ColourSample> sample_quad(const Image& rgb, const std::array<Vec2, 4>& corners);

// Finds the 24 patches of a colour chart (image/colour_correction.h) in an RGB image, in any orientation, with OpenCV's
// mcc module. The patches are numbered from `first_patch`, a multiple of 24; patches outside the image are left out.
// The result is empty if there is no chart, or if the chart is smaller than 60 pixels.
std::vector<ColourSample> find_colour_checker(const Image& rgb, CameraIndex camera, uint32_t first_patch);

// Removes charts that were misread because their patches were located at wrong positions. Such charts are recognised
// by their measured colours, which correlate less with the nominal colours of the patches than those of most other
// charts. All elements of `samples` must come from one camera, ordered by chart. If there are fewer than three charts,
// none is removed.
void remove_misread_charts(std::vector<ColourSample>& samples);

// Samples colours of the scene in overlapping views, so that no chart is needed. For each textured window of 9 x 9
// pixels in a reference camera, the function searches for the depth that makes other cameras show the same texture
// (highest normalised correlation, which does not depend on brightness). All cameras with a matching window get a
// sample.
//
// The geometry of the rig must be calibrated. `images` are RGB, one per camera in the order of the rig, captured at one
// instant and not colour-corrected; empty images are left out. Throws Error if an image does not have the size of its
// camera.
ColourSamples sample_views(const Rig& rig, std::span<const Image> images);

}  // namespace lf
