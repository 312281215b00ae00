// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>

#include "base/maths.h"
#include "base/memory.h"
#include "focus/hypothesis_projection.h"
#include "image/image.h"

namespace lf {

// Luma of an image for sampling hypotheses, low-passed by a box as large as the distance of their nodes, so that a
// quarter of the view's resolution suffices. Sides of boxes, pixels: kHypothesisBox, for a view with pixels as large as
// the camera's, times powers of two.
inline constexpr int kHypothesisBox = 4, kMaxHypothesisBox = 32;
// Value (x, y) is the mean of luma at x - 1 .. x + 2 and y - 1 .. y + 2, and belongs to (x + 1/2, y + 1/2). Larger
// boxes extend equally on all sides. The pixels at the image's edges are repeated beyond the image.
struct BoxedLuma {
  static constexpr size_t kSpare = 1;  // readable values at the end
  Rect rect;                           // part of the image that has values
  // Row-major, then kSpare unused values. The lower byte is the value, the upper one that of the row below (undefined
  // in the image's last row): a single load gets four neighbours from two values.
  UninitializedVector<uint16_t> values;
};
// Computes the values of `rect`, which is inside the image. `box`: side in pixels. Values of larger boxes are the
// rounded means of four boxes of half the size. The result is the same with every instruction set.
void box_luma(const ImageView& image, const Rect& rect, BoxedLuma& out, int box = kHypothesisBox);

// Luma of a camera at the nodes of a hypothesis, sampled bilinearly from its BoxedLuma and rounded to 8 bits. -1: not
// visible.
using HypothesisValues = UninitializedVector<int16_t>;

// Samples several hypotheses. `levels` and the result have a row for each, with as many values as `rays` and
// kHypothesisPadding more. Reads no more of the image than necessary. The result is the same with every instruction
// set.
HypothesisValues sample_hypotheses(const HypothesisProjection& projection, const HypothesisRays& rays,
                                   const ByteBuffer& levels, const ImageView& image);

// Rows of the sums of PhotoConsistency, a value for each node.
struct HypothesisSums {
  uint16_t *weight, *luma, *square;
};

// Computes the sums of `count` nodes from their values. All arrays have kHypothesisPadding unused values at the end.
void weigh_hypothesis(const float* weight, const int16_t* values, int count, const HypothesisSums& out);

// Nodes [x0, x1) of a camera in row y of the map. `first`: index of the first one among the camera's nodes.
struct HypothesisRow {
  int y, x0, x1;
  int first;
};
// Adds a camera's sums to the sums of a map with `columns` columns, saturating at 65535. `more`: at the camera's nodes,
// with kHypothesisPadding unused values at the end.
void add_rows(std::span<const HypothesisRow> rows, const HypothesisSums& more, int columns, size_t nodes,
              const HypothesisSums& sums);

}  // namespace lf
