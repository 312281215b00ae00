// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>

#include "base/maths.h"
#include "base/memory.h"
#include "focus/trial_projection.h"
#include "image/image.h"

namespace lf {

// Luma of an image, low-passed by a box of as many pixels as the nodes of trials are apart: what trials sample, so that
// a quarter of the view's resolution is enough. At full resolution: sampling an image of a quarter of the size costs
// 1 dB. Sides of boxes, pixels: the least, which belongs to a view with pixels as large as the camera's, and this times
// powers of two.
inline constexpr int kTrialBox = 4, kLargestTrialBox = 32;
// Value (x, y) is the mean of luma at x - 1 .. x + 2 and y - 1 .. y + 2 (in larger boxes by as much more at each side),
// as if the image went on beyond its edges as it is there: it belongs to (x + 1/2, y + 1/2).
struct BoxedLuma {
  static constexpr size_t kSpare = 1;  // values behind the others that may be read, too
  Rect rect;                           // part of the image that the values are of
  // Row-major, and kSpare of no meaning. The lower byte is the value, the upper one that of the row below (of no
  // meaning in the image's last row): four neighbours are in two values, so that one load has them.
  UninitializedVector<uint16_t> values;
};
// `rect`: what is needed, inside the image. `box`: pixels a side; values of larger boxes are the rounded means of four
// of half their size. The same result with every instruction set.
void box_luma(const ImageView& image, const Rect& rect, BoxedLuma& out, int box = kTrialBox);

// Luma that a camera has at nodes of a trial, sampled bilinearly from its BoxedLuma and rounded to 8 bits.
// -1: not seen.
using TrialValues = UninitializedVector<int16_t>;

// Samples as many trials as there are `levels`: rows of all of `rays` and kTrialSpare values, as in the result. Only
// what the trials look at is made of the image. The same result with every instruction set.
TrialValues see_trials(const TrialProjection& projection, const TrialRays& rays, const ByteBuffer& levels,
                       const ImageView& image);

// Rows of the sums of Moments, a value for each node.
struct TrialSums {
  uint16_t *weight, *luma, *square;
};

// Makes the sums of `count` nodes from their values; all arrays have `spare` values.
void weigh_trial(const float* weight, const int16_t* values, int count, const TrialSums& out);

// A camera's nodes [x0, x1) of row y of the map; `first`: of the camera's nodes, which lie one after the other.
struct TrialRow {
  int y, x0, x1;
  int first;
};
// Adds to sums of all nodes of a map of `columns`, at most 65535. `more`: of the camera's nodes, with `spare` values.
void add_rows(std::span<const TrialRow> rows, const TrialSums& more, int columns, size_t nodes, const TrialSums& sums);

}  // namespace lf
