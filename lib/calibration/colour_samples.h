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

// Measured colour of a patch in one camera. A patch is a small area of uniform colour, on a chart or in the scene. Its
// unknown colour is equal for all cameras.
struct ColourSample {
  CameraIndex camera = 0;
  uint32_t patch = 0;
  Vec2 place{0, 0};              // centre of the patch, pixels
  Vec3 level{0, 0, 0};           // mean of the patch's pixels, 0..255
  std::array<bool, 3> usable{};  // channels without clipped pixels
  double sigma = 1;              // standard deviation of the mean, levels
};

struct ColourSamples {
  size_t cameras = 0;
  uint32_t patches = 0;
  // Columns and rows of the chart: patch p and patch p + columns x rows are the same patch at different chart
  // positions. Without a chart both are 0 and all patches are different.
  int chart_columns = 0, chart_rows = 0;
  std::vector<ColourSample> all;
};

// Returns the mean of an RGB image over a quadrilateral with these corners, in order around it; the caller sets camera
// and patch. A channel is usable if at most 1 % of its pixels are clipped (2 or less, 253 or more), because clipping
// biases the mean. Returns nullopt if the quadrilateral covers fewer than 9 pixels or leaves the image.
std::optional<ColourSample> sample_quad(const Image& rgb, const std::array<Vec2, 4>& corners);

// Finds the 24 patches of a colour chart (image/colour_correction.h) in an RGB image, in any orientation, with OpenCV's
// mcc module. Patches are numbered from `first_patch` (a multiple of 24); patches outside the image are left out. Empty
// if there is no chart, or if it is smaller than 60 pixels.
std::vector<ColourSample> find_colour_checker(const Image& rgb, CameraIndex camera, uint32_t first_patch);

// Removes misread charts from the samples of one camera, ordered by chart: charts that correlate less with the nominal
// colours than most, because the patch positions are wrong. Removes nothing if there are fewer than three charts.
void remove_misread_charts(std::vector<ColourSample>& samples);

// Samples scene points in overlapping views, without a chart. For each textured 9 x 9 window of a reference camera, a
// sweep over depths finds the distance with the highest normalised correlation, which is independent of brightness. All
// cameras with a matching window get a sample. The rig's geometry must be calibrated. `images`: RGB, one per camera in
// the rig's order, captured at one instant, uncorrected; empty images are left out. Throws Error if the size of an
// image differs from its camera's.
ColourSamples sample_views(const Rig& rig, std::span<const Image> images);

}  // namespace lf
