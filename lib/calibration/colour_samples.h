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

// Samples of the 24 patches of a colour chart (image/colour_correction.h) that OpenCV's mcc module finds in an RGB
// image, in any orientation: patches `first_patch` (a multiple of 24) to first_patch + 23, those of them that are in
// the image. Empty where there is no chart, or one that is smaller than 60 pixels.
std::vector<ColourSample> find_colour_checker(const Image& rgb, CameraIndex camera, uint32_t first_patch);

// Of the charts that one camera was shown, `samples` in their order, takes out those that follow the chart's colours
// less well than most: patches are not where they were looked for. Nothing is taken out of less than three charts.
void leave_out_misread_charts(std::vector<ColourSample>& samples);

// Samples of places of a scene in overlapping views, without a chart: of each reference camera's image windows of 9 x 9
// pixels that have texture, at the distance at which the other cameras' windows are most like them (a sweep of the
// normalised correlation, which knows nothing of brightness), in all cameras whose windows agree. The rig's geometry is
// calibrated. `images`: RGB, one a camera in the rig's order, of one instant, as they come; those of no size are left
// out. Throws Error for an image that is not of its camera's size.
ColourSamples sample_views(const Rig& rig, std::span<const Image> images);

}  // namespace lf
