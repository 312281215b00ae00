// SPDX-License-Identifier: LGPL-2.1-or-later
// Included once per instruction set, see render_band.cc: computes the weights of all local cameras in a band.
#if defined(LF_RENDER_SIMD_WEIGHTS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_RENDER_SIMD_WEIGHTS_INL_H_
#undef LF_RENDER_SIMD_WEIGHTS_INL_H_
#else
#define LF_RENDER_SIMD_WEIGHTS_INL_H_
#endif

#include <cmath>

#include <hwy/highway.h>

#include "render/camera_weights.h"
#include "render/simd/samples-inl.h"
#include "render/simd/sum_task.h"

HWY_BEFORE_NAMESPACE();
namespace lf::simd::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// The weights of a face usually vary smoothly along a block. A parabola through three exact weights then gives the
// weights of a row. Otherwise, the weights are computed pixel by pixel.

#if HWY_TARGET == HWY_SCALAR

inline bool fit_weights(const FacePlan&, const Rays&, int, int, FaceBlock&) { return false; }
inline void spread_weights(const FaceBlock&, Scratch&) {}

#else

// Intermediate weights are unsigned, and weight 1 is 2^30. This offset contains 1/2, so that a weight may be slightly
// negative, and half a unit of the final weight for rounding.
inline constexpr uint32_t kWeightOffset = (1u << 29) + (1u << 14);

// Largest permitted error of the parabola through the weights at t = 0, 1/2 and 1. If the sum of the edge functions
// changes by the fraction c along a block, and the weight by `rise`, the error is at most 0.0481 c^2 rise.
inline constexpr float kLargestMiss = 1e-5f;

// Fits parabolas to the weights of a face in the block at x, in all rows of the band that begins at y. Returns false if
// the weights are not smooth enough. The decision depends only on these arguments, so all hosts make the same decision.
inline bool fit_weights(const FacePlan& face, const Rays& rays, int x, int y, FaceBlock& out) {
  if (!rays.separable()) return false;
  const hn::CappedTag<float, kBandRows> d;
  const hn::RebindToUnsigned<decltype(d)> du;
  const Vec2 corner = rays.at(x, y), next = rays.at(x + kBlock / 2, y + 1);
  const double u_half = next.x - corner.x, v_step = next.y - corner.y;
  double start[3], half[3], down[3];
  for (int k = 0; k < 3; k++) {
    start[k] = FacePlan::evaluate(face.edge[k], corner);
    half[k] = face.edge[k].x * u_half;
    down[k] = face.edge[k].y * v_step;
  }
  const auto set = [&](double v) HWY_ATTR { return hn::Set(d, static_cast<float>(v)); };
  const auto sum_start = set(start[0] + start[1] + start[2]), sum_half = set(half[0] + half[1] + half[2]),
             sum_down = set(down[0] + down[1] + down[2]);
  auto all = hn::Eq(sum_start, sum_start);
  for (int row = 0; row < kBandRows; row += static_cast<int>(hn::Lanes(d))) {
    const auto j = hn::Iota(d, static_cast<float>(row));
    const auto sum0 = hn::MulAdd(j, sum_down, sum_start), sum1 = hn::Add(sum0, sum_half),
               sum2 = hn::Add(sum1, sum_half);
    const auto scale0 = hn::Div(set(1), sum0), scale1 = hn::Div(set(1), sum1), scale2 = hn::Div(set(1), sum2);
    auto largest_rise = hn::Zero(d);
    for (int k = 0; k < 3; k++) {
      const auto e0 = hn::MulAdd(j, set(down[k]), set(start[k]));
      const auto e1 = hn::Add(e0, set(half[k])), e2 = hn::Add(e1, set(half[k]));
      const auto w0 = hn::Mul(e0, scale0), w1 = hn::Mul(e1, scale1), w2 = hn::Mul(e2, scale2);
      const auto rise = hn::Sub(w2, w0), bend = hn::NegMulAdd(set(2), w1, hn::Add(w0, w2));
      largest_rise = hn::Max(largest_rise, hn::Abs(rise));
      // As in to_low_bits(); the low bits that remain after the shift are `at` in units of 2^-20.
      constexpr int kShift = 10;
      static_assert(kWeightOffset % (1 << kShift) == 0);
      const auto at = hn::MulAdd(w0, set(1 << 20), set(kMagic + static_cast<float>(kWeightOffset >> kShift)));
      hn::Store(hn::ShiftLeft<kShift>(hn::BitCast(du, at)), du, out.at[k] + row);
      const auto low = hn::And(hn::BitCast(du, hn::MulAdd(rise, set(32768), set(kMagic))), hn::Set(du, 0xffff));
      const auto high = hn::ShiftLeft<16>(hn::BitCast(du, hn::MulAdd(bend, set(8 * 32768), set(kMagic))));
      hn::Store(hn::Or(low, high), du, out.rise_bend[k] + row);
    }
    // A sum that changes its sign changes by more than its own value.
    const auto change = hn::Abs(hn::Mul(hn::Add(sum_half, sum_half), scale1));
    const auto miss = hn::Mul(hn::Mul(change, change), hn::Mul(largest_rise, set(0.0481)));
    const auto fits = hn::And(hn::Lt(change, set(0.125)), hn::Lt(largest_rise, set(0.99)));
    all = hn::And(all, hn::And(fits, hn::Lt(miss, set(kLargestMiss))));
  }
  return hn::AllTrue(d, all);
}

// Constants for evaluating the parabolas. `even` and `odd` contain the factors of rise and bend for the even and odd
// pixels of a block, in pairs; 1 is 2^15. `from` and `to` contain masks: a load at a suitable offset gives a mask of
// the pixels from x0 on or before x1.
struct SpreadTable {
  alignas(64) int16_t even[kBlock], odd[kBlock];
  alignas(64) int16_t from[2 * kBlock], to[2 * kBlock];
};
constexpr SpreadTable make_spread_table() {
  SpreadTable table{};
  for (int i = 0; i < kBlock; i++) {
    const int t = i * (32768 / kBlock), t_next = 32768 - t;
    int16_t* const pair = (i % 2 ? table.odd : table.even) + i / 2 * 2;
    pair[0] = static_cast<int16_t>(t);
    pair[1] = static_cast<int16_t>(-(t / 4 * (t_next / 8) / (32768 / 8)));
    table.from[kBlock + i] = table.to[i] = -1;
  }
  return table;
}
inline constexpr SpreadTable kSpread = make_spread_table();

// Evaluates the parabolas of a face at the pixels of a block, and writes the weights of its local cameras.
inline void spread_weights(const FaceBlock& face, Scratch& scratch) {
  const hn::CappedTag<int16_t, kBlock> d;
  const hn::RebindToUnsigned<decltype(d)> du;
  const hn::Repartition<uint32_t, decltype(d)> d32;
  const hn::Repartition<int32_t, decltype(d)> di32;
  BlockWeights* out[3];
  int corner[3], count = 0;
  for (int k = 0; k < 3; k++)
    if (face.corners >> k & 1) {
      out[count] = &scratch.weights[face.entry[k]];
      out[count]->rows |= face.rows;
      corner[count++] = k;
    }
  for (size_t lane = 0; lane < kBlock; lane += hn::Lanes(d)) {
    const auto even = hn::Load(d, kSpread.even + lane), odd = hn::Load(d, kSpread.odd + lane);
    for (uint32_t rows = face.rows; rows != 0; rows &= rows - 1) {
      const size_t r = hwy::Num0BitsBelowLS1Bit_Nonzero32(rows);
      const auto inside = hn::And(hn::LoadU(d, kSpread.from + kBlock - face.x0[r] + lane),
                                  hn::LoadU(d, kSpread.to + kBlock - face.x1[r] + lane));
      const auto spread = [&](int k, int16_t* to) HWY_ATTR {
        const auto factors = hn::BitCast(d, hn::Set(d32, face.rise_bend[k][r]));
        const auto at = hn::BitCast(di32, hn::Set(d32, face.at[k][r]));
        const auto sum_of = [&](const auto places) HWY_ATTR {
          auto other = hn::Zero(di32);
          const auto sum = hn::ReorderWidenMulAccumulate(di32, factors, places, at, other);
          return hn::BitCast(d32, hn::RearrangeToOddPlusEven(sum, other));
        };
        const auto low = hn::BitCast(du, hn::ShiftRight<15>(sum_of(even)));
        const auto high = hn::BitCast(du, hn::ShiftLeft<1>(sum_of(odd)));
        const auto w = hn::SaturatedSub(hn::OddEven(high, low), hn::Set(du, 1 << 14));
        const auto w16 = hn::BitCast(d, hn::Min(w, hn::Set(du, 32767)));
        hn::Store(hn::Or(hn::Load(d, to + lane), hn::And(w16, inside)), d, to + lane);
      };
      if (HWY_LIKELY(count == 3)) {
        spread(0, out[0]->w[r]);
        spread(1, out[1]->w[r]);
        spread(2, out[2]->w[r]);
      } else {
        for (int i = 0; i < count; i++) spread(corner[i], out[i]->w[r]);
      }
    }
  }
}

#endif

// Returns the index in scratch.weights of a camera's weights in a block, after creating an entry with weights of 0 if
// there is none.
inline int32_t entry_of(Scratch& scratch, int block, int32_t slot) {
  for (int32_t i = scratch.head[block]; i >= 0; i = scratch.weights[i].next)
    if (scratch.weights[i].slot == slot) return i;
  if (scratch.weights_used == scratch.weights.size()) scratch.weights.resize(2 * scratch.weights.size() + 64);
  const int32_t number = static_cast<int32_t>(scratch.weights_used++);
  BlockWeights& entry = scratch.weights[number];
  const hn::CappedTag<int16_t, kBlock> d;
  for (auto& row : entry.w)
    for (size_t i = 0; i < kBlock; i += hn::Lanes(d)) hn::Store(hn::Zero(d), d, row + i);
  entry.slot = slot;
  entry.rows = 0;
  entry.next = scratch.head[block];
  scratch.head[block] = number;
  return number;
}

// Returns the index in scratch.faces of a face in a block, and creates the entry if it does not exist. `block` is the
// index of the block in the rectangle, and (x, y) the first pixel of the block and of the band.
HWY_INLINE int32_t face_in_block(const SumTask& task, Scratch& scratch, int block, int x, int y, int32_t face,
                                 uint8_t corners) {
  LastFaces& last = scratch.last_faces[block];
  if (last.face[0] == face) return last.number[0];
  if (last.face[1] == face) return last.number[1];
  if (scratch.faces_used == scratch.faces.size()) scratch.faces.resize(2 * scratch.faces.size() + 64);
  const int32_t number = static_cast<int32_t>(scratch.faces_used++);
  last = {{face, last.face[0]}, {number, last.number[0]}};
  FaceBlock& made = scratch.faces[number];
  const FacePlan& plan = task.plan->faces()[face];
  made.face = face;
  made.corners = corners;
  for (int k = 0; k < 3; k++)
    if (corners >> k & 1) made.entry[k] = entry_of(scratch, block, task.slot_of_camera[plan.camera[k]]);
  made.rows = 0;
  made.smooth = fit_weights(plan, task.plan->rays(), x, y, made);
  return number;
}

// Computes the weights e_k / (e_0 + e_1 + e_2) of `corners` for pixels [x0, x1) of one block and row; x is relative to
// the block. `e` are the edge functions at x0, and `step` their increments per pixel. The computation starts at the
// face's first pixel, to avoid values from outside the face.
inline void weigh(const float e[3], const float step[3], int x0, int x1, uint8_t corners, int16_t* const out[3]) {
  const hn::CappedTag<float, kBlock> df;
  const hn::Rebind<int16_t, decltype(df)> d16;
  const int lanes = static_cast<int>(hn::Lanes(df));
  const auto iota = hn::Iota(df, 0);
  const auto first = hn::Set(df, static_cast<float>(x0)), past = hn::Set(df, static_cast<float>(x1));
  // If the sum varies little, one or two Newton steps from its middle are as accurate as a division, and faster. Each
  // step squares the relative error, initially 1/256 or 1/16.
  const float sum_x0 = e[0] + e[1] + e[2];
  const float half_change = 0.5f * static_cast<float>(x1 - 1 - x0) * (step[0] + step[1] + step[2]);
  const float middle = sum_x0 + half_change;
  const float change = std::abs(half_change), largest = std::abs(middle);
  const bool divide = !(change * 16 < largest), once = change * 256 < largest;
  const auto guess = hn::Set(df, 1 / middle), two = hn::Set(df, 2.f);
  for (int i = x0 / lanes * lanes; i < x1; i += lanes) {
    const auto x = hn::Add(iota, hn::Set(df, static_cast<float>(i)));
    const auto from_x0 = hn::Sub(x, first);
    const auto e0 = hn::MulAdd(from_x0, hn::Set(df, step[0]), hn::Set(df, e[0]));
    const auto e1 = hn::MulAdd(from_x0, hn::Set(df, step[1]), hn::Set(df, e[1]));
    const auto e2 = hn::MulAdd(from_x0, hn::Set(df, step[2]), hn::Set(df, e[2]));
    const auto inside = hn::And(hn::Ge(x, first), hn::Lt(x, past));
    const auto sum = hn::Add(hn::Add(e0, e1), e2), one = hn::Set(df, 32768.f);
    auto scale = guess;
    if (HWY_UNLIKELY(divide)) {
      scale = hn::Div(one, sum);
    } else {
      scale = hn::Mul(guess, hn::NegMulAdd(sum, guess, two));
      if (!once) scale = hn::Mul(scale, hn::NegMulAdd(sum, scale, two));
      scale = hn::Mul(scale, one);
    }
    const auto store = [&](const auto e_k, int16_t* to) HWY_ATTR {
      // Rounding may move a weight slightly outside 0 to 1 at an edge. NaN becomes 0.
      const auto w = hn::Min(hn::Max(hn::Mul(e_k, scale), hn::Zero(df)), hn::Set(df, 32767.f));
      const auto w16 = hn::BitCast(d16, to_fixed(d16, hn::IfThenElseZero(inside, w)));
      hn::Store(hn::Or(hn::Load(d16, to + i), w16), d16, to + i);
    };
    if (corners & 1) store(e0, out[0]);
    if (corners & 2) store(e1, out[1]);
    if (corners & 4) store(e2, out[2]);
  }
}

// Computes the weights of a face in pixels [x, x1) of row y, pixel by pixel. The pixels are in one block and belong to
// `run`.
inline void weigh_exactly(const SumTask& task, const FaceRun& run, int y, int x, int x1, const FaceBlock& block,
                          Scratch& scratch) {
  const FacePlan& face = task.plan->faces()[run.face];
  const Rays& rays = task.plan->rays();
  const int left = x / kBlock * kBlock, r = y % kBandRows;
  int16_t* out[3] = {};
  for (int k = 0; k < 3; k++)
    if (block.corners >> k & 1) out[k] = scratch.weights[block.entry[k]].w[r];
  float e[3], step[3] = {};
  if (!rays.separable()) {
    for (; x < x1; x++) {
      for (int k = 0; k < 3; k++) e[k] = static_cast<float>(FacePlan::evaluate(face.edge[k], rays.at(x, y)));
      weigh(e, step, x - left, x + 1 - left, block.corners, out);
    }
    return;
  }
  const Vec2 begin = rays.at(run.x0, y);
  const double u_step = rays.at(1, 0).x - rays.at(0, 0).x;
  for (int k = 0; k < 3; k++) {
    const double e_step = face.edge[k].x * u_step;
    step[k] = static_cast<float>(e_step);
    e[k] = static_cast<float>(FacePlan::evaluate(face.edge[k], begin) + (x - run.x0) * e_step);
  }
  weigh(e, step, x - left, x1 - left, block.corners, out);
}

// Marks the pixels in scratch.grid_pixels that take their weights from the WeightGrid.
inline void find_grid_pixels(const SumTask& task, int first_block, int blocks, int first_row, int past_row, int y,
                             Scratch& scratch) {
  static_assert(kBlock == 16, "a mask has a bit for each pixel of a block");
  scratch.grid_pixels.assign(static_cast<size_t>(blocks) * kBandRows, 0);
  const int blocks_x0 = first_block * kBlock, blocks_x1 = blocks_x0 + blocks * kBlock;
  const auto last = static_cast<int32_t>(task.plan->faces().size()) - 1;
  for (int r = first_row; r < past_row; r++)
    for (const FaceRun& run : task.runs->row(y + r, blocks_x0, blocks_x1)) {
      if (run.face != last) continue;
      const int run_x1 = std::min(run.x1, blocks_x1);
      for (int x = std::max(run.x0, blocks_x0), end; x < run_x1; x = end) {
        const int block = x / kBlock, left = block * kBlock;
        end = std::min(run_x1, left + kBlock);
        const uint32_t pixels = (1u << (end - left)) - (1u << (x - left));
        scratch.grid_pixels[static_cast<size_t>(block - first_block) * kBandRows + r] |= static_cast<uint16_t>(pixels);
      }
    }
}

// Computes the weights of all pixels in a row of a cell, like WeightGrid::CellRow::weight().
HWY_INLINE void grid_weights(const WeightGrid::CellRow& row, int16_t out[kBlock]) {
  const hn::CappedTag<int32_t, kBlock> d;
  const hn::Rebind<int16_t, decltype(d)> d16;
  for (size_t i = 0; i < kBlock; i += hn::Lanes(d)) {
    const auto x = hn::Iota(d, static_cast<int32_t>(i));
    const auto level = [&](int32_t left, int32_t right) HWY_ATTR {
      const auto first = hn::Set(d, left * WeightGrid::kStep + WeightGrid::CellRow::kHalf);
      return hn::ShiftRight<2 * WeightGrid::kStepBits>(hn::Add(first, hn::Mul(x, hn::Set(d, right - left))));
    };
    const auto weight = hn::Sub(level(row.left, row.right), level(row.left_before, row.right_before));
    hn::StoreU(hn::DemoteTo(d16, hn::Min(weight, hn::Set(d, 32767))), d16, out + i);
  }
}

// Computes the weights in a band of the pixels that take their weights from the WeightGrid.
inline void blend_band(const SumTask& task, const Rect& rect, int y, Scratch& scratch) {
  static_assert(WeightGrid::kStep == kBlock && WeightGrid::kStep % kBandRows == 0 && WeightGrid::kOne == 1 << 15);
  const WeightGrid& grid = *task.plan->blend();
  const int first_block = rect.x0 / kBlock, blocks = (rect.x1 + kBlock - 1) / kBlock - first_block;
  const int first_row = std::max(0, rect.y0 - y), past_row = std::min(kBandRows, rect.y1 - y);
  find_grid_pixels(task, first_block, blocks, first_row, past_row, y, scratch);
  for (int32_t number = 0; number < static_cast<int32_t>(task.slots.size()); number++) {
    const Rect at = intersect(task.slots[number].rect, {rect.x0, y, rect.x1, y + kBandRows});
    if (at.empty()) continue;
    for (int block = at.x0 / kBlock; block * kBlock < at.x1; block++) {
      WeightGrid::Cell cell;
      if (!grid.find(task.slots[number].camera, block, y / WeightGrid::kStep, cell)) continue;
      const uint16_t* const pixels = &scratch.grid_pixels[static_cast<size_t>(block - first_block) * kBandRows];
      BlockWeights& entry = scratch.weights[entry_of(scratch, block - first_block, number)];
      for (int r = first_row; r < past_row; r++) {
        if (pixels[r] == 0) continue;
        const WeightGrid::CellRow row = cell.row((y + r) % WeightGrid::kStep);
        if (pixels[r] == 0xffff) {
          grid_weights(row, entry.w[r]);
        } else {
          for (int x = 0; x < kBlock; x++)
            if (pixels[r] >> x & 1) entry.w[r][x] = static_cast<int16_t>(std::min(row.weight(x), 32767));
        }
        entry.rows |= 1u << r;
      }
    }
  }
}

// Computes the weights in a band of the pixels that belong to a face of the mesh.
inline void weigh_band(const SumTask& task, const Rect& rect, int y, Scratch& scratch) {
  scratch.weights_used = scratch.faces_used = 0;
  const int first_block = rect.x0 / kBlock, blocks = (rect.x1 + kBlock - 1) / kBlock - first_block;
  std::fill_n(scratch.head.begin(), blocks, -1);
  std::fill_n(scratch.last_faces.begin(), blocks, LastFaces{});
  // Whole blocks are weighed regardless of the rectangle, so that a pixel has the same weights in every rectangle.
  const int blocks_x0 = first_block * kBlock, blocks_x1 = blocks_x0 + blocks * kBlock;
  for (int r = std::max(0, rect.y0 - y); r < kBandRows && y + r < rect.y1; r++)
    for (const FaceRun& run : task.runs->row(y + r, blocks_x0, blocks_x1)) {
      const uint8_t corners = task.face_corners[run.face];
      if (!corners) continue;
      const int run_x1 = std::min(run.x1, blocks_x1);
      for (int x = std::max(run.x0, blocks_x0), end; x < run_x1; x = end) {
        const int block = x / kBlock, left = block * kBlock;
        end = std::min(run_x1, left + kBlock);
        const int32_t number = face_in_block(task, scratch, block - first_block, left, y, run.face, corners);
        FaceBlock& face = scratch.faces[number];
        if (HWY_UNLIKELY(!face.smooth)) {
          weigh_exactly(task, run, y + r, x, end, face, scratch);
          for (int k = 0; k < 3; k++)
            if (corners >> k & 1) scratch.weights[face.entry[k]].rows |= 1u << r;
          continue;
        }
        if (HWY_UNLIKELY(face.rows >> r & 1)) {  // the face has a run in this row already
          spread_weights(face, scratch);
          face.rows = 0;
        }
        face.rows |= 1u << r;
        face.x0[r] = static_cast<uint8_t>(x - left);
        face.x1[r] = static_cast<uint8_t>(end - left);
      }
    }
  for (size_t i = 0; i < scratch.faces_used; i++)
    if (scratch.faces[i].smooth) spread_weights(scratch.faces[i], scratch);
  if (task.plan->blend()) blend_band(task, rect, y, scratch);
}

// The place of a pixel between two nodes of a focal map with a node for every kCell pixels: the index of the first of
// them, counted from the node before the block, and the distance from it in eighths.
struct NodePlace {
  constexpr explicit NodePlace(int pixel) : node((2 * pixel + 5) / 8), eighths((2 * pixel + 5) % 8) {}
  int node, eighths;
};
static_assert(kCell == 4, "pixels are at odd eighths between nodes");

// Returns true if a block of a band has depth edges. Its first pixel is (x, y).
inline bool has_edges(const DepthEdges& edges, int x, int y) {
  const int right = std::min(DepthEdges::cell_of(x + kBlock - 1), edges.columns - 1);
  const int bottom = std::min(DepthEdges::cell_of(y + kBandRows - 1), edges.rows - 1);
  for (int j = DepthEdges::cell_of(y); j <= bottom; j++)
    for (int i = DepthEdges::cell_of(x); i <= right; i++)
      if (edges.index_of(i, j) >= 0) return true;
  return false;
}

// Replaces the values of pixels in cells with depth edges, in row y of the view. `seen` are the values of a block that
// begins at pixel x; 64 * kVisible is 1.
inline void mask_edges(const VisibilityMask& mask, const DepthEdges& edges, int x, int y, int16_t* seen) {
  const int row = DepthEdges::cell_of(y);
  if (row >= edges.rows) return;
  for (int i = 0; i < kBlock; i++) {
    const int column = DepthEdges::cell_of(x + i);
    if (column >= edges.columns) return;
    const int32_t edge = edges.index_of(column, row);
    if (edge >= 0)
      seen[i] = static_cast<int16_t>(
          64 * mask.edges[edge][DepthEdges::in_cell(y) * DepthEdges::kSize + DepthEdges::in_cell(x + i)]);
  }
}

// Multiplies the weights of a block by a visibility mask, and adds the rest to the missing weight. `x` and `y` are the
// first pixel, and `lost` the missing weight of each row at this pixel. Returns true if any weight has changed.
inline bool mask_block(const VisibilityMask& mask, const DepthEdges* edges, int x, int y, BlockWeights& weights,
                       uint16_t* const lost[kBandRows]) {
  constexpr int kColumns = kBlock / kCell + 2;  // nodes around the block
  int16_t nodes[kCellRows][kColumns];
  int hidden = 0;
  for (int k = 0; k < kCellRows; k++) {
    const int j = std::clamp(y / kCell + k - 1, 0, mask.rows - 1);
    const uint8_t* const row = &mask.nodes[static_cast<size_t>(j) * mask.columns];
    for (int i = 0; i < kColumns; i++) {
      nodes[k][i] = row[std::clamp(x / kCell + i - 1, 0, mask.columns - 1)];
      hidden |= VisibilityMask::kVisible - nodes[k][i];
    }
  }
  if (edges && !has_edges(*edges, x, y)) edges = nullptr;
  if (hidden == 0 && !edges) return false;
  const hn::CappedTag<int16_t, kBlock> d;
  const hn::RebindToUnsigned<decltype(d)> du;
  for (int r = 0; r < kBandRows; r++) {
    if (!(weights.rows >> r & 1)) continue;
    const NodePlace down(r);
    int16_t between[kColumns];  // 8 * kVisible is 1
    for (int i = 0; i < kColumns; i++)
      between[i] =
          static_cast<int16_t>((8 - down.eighths) * nodes[down.node][i] + down.eighths * nodes[down.node + 1][i]);
    alignas(64) int16_t seen[kBlock];  // 64 * kVisible is 1
    for (int i = 0; i < kBlock; i++) {
      const NodePlace along(i);
      seen[i] =
          static_cast<int16_t>((8 - along.eighths) * between[along.node] + along.eighths * between[along.node + 1]);
    }
    if (edges) mask_edges(mask, *edges, x, y + r, seen);
    for (size_t i = 0; i < kBlock; i += hn::Lanes(d)) {
      const auto v = hn::Load(d, seen + i), w = hn::Load(d, weights.w[r] + i);
      // 64 * 255 becomes 32767.
      const auto part = hn::Add(hn::Add(v, v), hn::ShiftRight<7>(v));
      const auto reduced = hn::Min(hn::MulFixedPoint15(w, part), w);
      hn::Store(reduced, d, weights.w[r] + i);
      const auto before = hn::LoadU(du, lost[r] + i);
      hn::StoreU(hn::SaturatedAdd(before, hn::BitCast(du, hn::Sub(w, reduced))), du, lost[r] + i);
    }
  }
  return true;
}

// Multiplies the weights of slots with a visibility mask by its values, and counts the rest as missing weight.
// scratch.lost must be initialised.
inline void apply_visibility(const SumTask& task, const Rect& rect, int y, Scratch& scratch) {
  const int first_block = rect.x0 / kBlock, blocks = (rect.x1 + kBlock - 1) / kBlock - first_block;
  for (int block = 0; block < blocks; block++) {
    uint16_t* lost[kBandRows];
    for (int r = 0; r < kBandRows; r++) lost[r] = scratch.lost[r] + block * kBlock;
    for (int32_t i = scratch.head[block]; i >= 0; i = scratch.weights[i].next) {
      BlockWeights& weights = scratch.weights[i];
      const VisibilityMask* const mask = task.slots[weights.slot].visibility;
      if (mask && mask_block(*mask, task.slots[weights.slot].edges, (first_block + block) * kBlock, y, weights, lost))
        scratch.any_missing = true;
    }
  }
}

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
