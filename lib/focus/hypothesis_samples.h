// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>

#include "base/maths.h"
#include "base/memory.h"
#include "focus/hypothesis_projection.h"
#include "image/image.h"

namespace lf {

// The luma of an image, low-passed by a box. Hypotheses only sample the image at the nodes of a focal map, which are
// several pixels apart, so the box is about as large as the distance between the nodes. The sides of boxes are
// kHypothesisBox pixels, for a view with pixels as large as the camera's, times powers of two.
inline constexpr int kHypothesisBox = 4, kMaxHypothesisBox = 32;
// For the smallest box, value (x, y) is the mean of luma at columns x - 1 to x + 2 and rows y - 1 to y + 2, and belongs
// to the position (x + 1/2, y + 1/2). Larger boxes extend equally on all sides. The border pixels of the image are
// repeated beyond the image.
struct BoxedLuma {
  static constexpr size_t kSpare = 1;  // readable values at the end
  Rect rect;                           // part of the image that has values
  // Row-major, then kSpare unused values. The lower byte is the value, and the upper byte the value in the row below
  // (undefined in the last row of the image). Bilinear interpolation thus needs a single load of two adjacent entries
  // to get four neighbours.
  UninitializedVector<uint16_t> values;
};
// Computes the low-pass filtered luma in `rect`, which must be inside the image. The filter is a mean over a square of
// `box` x `box` pixels. A box larger than kHypothesisBox is the rounded mean of the four half-size boxes inside it. The
// result is identical for every instruction set.
void box_luma(const ImageView& image, const Rect& rect, BoxedLuma& out, int box = kHypothesisBox);

// The luma of a camera at the nodes of a hypothesis, sampled bilinearly from a BoxedLuma and rounded to 8 bits. It is
// -1 at nodes that are not visible.
using HypothesisValues = UninitializedVector<int16_t>;

// Samples the luma of an image at the nodes of several hypotheses. `levels` and the result have one row for each
// hypothesis, with as many values as `rays`, plus kHypothesisPadding. Reads no more of the image than necessary. All
// instruction sets give the same result.
HypothesisValues sample_hypotheses(const HypothesisProjection& projection, const HypothesisRays& rays,
                                   const ByteBuffer& levels, const ImageView& image);

// Pointers to rows of the sums of a PhotoConsistency, with one value for each node.
struct HypothesisSums {
  uint16_t *weight, *luma, *square;
};

// Computes one camera's contribution to the sums at `count` nodes, from its weights and its luma there. All arrays have
// kHypothesisPadding unused values at the end.
void weigh_hypothesis(const float* weight, const int16_t* values, int count, const HypothesisSums& out);

// Nodes [x0, x1) in row y of the map, where a camera has a weight. `first` is the index of the first of these nodes in
// the camera's arrays.
struct HypothesisRow {
  int y, x0, x1;
  int first;
};
// Adds a camera's sums to the sums of the whole map, which has `columns` columns and `nodes` nodes. Sums saturate at
// 65535. `more` contains the sums at the camera's nodes, with kHypothesisPadding unused values at the end.
void add_rows(std::span<const HypothesisRow> rows, const HypothesisSums& more, int columns, size_t nodes,
              const HypothesisSums& sums);

}  // namespace lf
