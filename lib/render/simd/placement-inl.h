// SPDX-License-Identifier: LGPL-2.1-or-later
// Included once per instruction set, see render_band.cc: decides where the samples of a band of a view lie in one
// camera's image, and how they are read. No pixel is read yet. It has one variant for a focal plane and one for a focal
// map with nodes kCell pixels apart. sum_task.h explains the terms.
#if defined(LF_RENDER_SIMD_PLACEMENT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_RENDER_SIMD_PLACEMENT_INL_H_
#undef LF_RENDER_SIMD_PLACEMENT_INL_H_
#else
#define LF_RENDER_SIMD_PLACEMENT_INL_H_
#endif

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <vector>

#include <hwy/highway.h>

#include "render/simd/cells-inl.h"
#include "render/simd/samples-inl.h"
#include "render/simd/sum_task.h"

HWY_BEFORE_NAMESPACE();
namespace lf::simd::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Prepares the arrays for a focal plane. `pitch` is the number of nodes in a row, which are kBlock pixels apart.
inline void lay_nodes(int pitch, SlotBand& band) {
  if (band.pitch == pitch) return;
  band.pitch = pitch;
  const size_t padded = static_cast<size_t>(pitch) * kBandRows + 2 * kBlock;  // whole vectors
  if (band.node_z.size() < padded) {
    band.luma.resize(padded);
    band.chroma.resize(padded);
    band.node_z.resize(padded);
    band.method.resize(padded);
  }
  band.columns.assign(padded, 0);
  band.rows.assign(padded, 0);
  for (int row = 0, i = 0; row < kBandRows; row++)
    for (int column = 0; column < pitch; column++, i++) {
      band.columns[i] = static_cast<float>(column * kBlock);
      band.rows[i] = static_cast<float>(row);
    }
}

// Projects the nodes of all rows of the band into the camera's image. Positions of nodes that the camera cannot see are
// NaN.
inline void project_nodes(const Slot& slot, int y, SlotBand& out) {
  const hn::CappedTag<float, kBlock> d;
  const ProjectionTerms terms = terms_at(slot, (out.first_block - 1) * kBlock, y);
  const Projection projection(slot, terms);
  const size_t lanes = hn::Lanes(d), nodes = static_cast<size_t>(out.pitch) * kBandRows;
  for (size_t i = 0; i < nodes; i += lanes) {
    hn::Vec<decltype(d)> px, py, z, reach;
    projection.project(d, hn::LoadU(d, out.columns.data() + i), hn::LoadU(d, out.rows.data() + i), px, py, z, reach);
    const auto seen = hn::And(hn::Gt(z, hn::Zero(d)), hn::Le(reach, hn::Set(d, slot.distortion.limit)));
    hn::StoreU(hn::IfThenElse(seen, px, hn::NaN(d)), d, out.luma.node_x.data() + i);
    hn::StoreU(hn::IfThenElse(seen, py, hn::NaN(d)), d, out.luma.node_y.data() + i);
    hn::StoreU(z, d, out.node_z.data() + i);
  }
}

// Computes the chroma positions of the nodes from their luma positions, for the chroma row between two rows. Chroma
// sample k is at luma 2 k + 0.5.
inline void place_chroma_nodes(SlotBand& band) {
  const hn::CappedTag<float, kBlock> d;
  for (int pair = 0; pair < kBandPairs; pair++) {
    const int upper = 2 * pair * band.pitch, lower = upper + band.pitch;
    const auto middle = [&](const std::vector<float>& of, int i) HWY_ATTR {
      const auto sum = hn::Add(hn::LoadU(d, of.data() + upper + i), hn::LoadU(d, of.data() + lower + i));
      return hn::Mul(hn::Sub(sum, hn::Set(d, 1.f)), hn::Set(d, 0.25f));
    };
    for (int i = 0; i < band.pitch; i += static_cast<int>(hn::Lanes(d))) {
      hn::StoreU(middle(band.luma.node_x, i), d, band.chroma.node_x.data() + pair * band.pitch + i);
      hn::StoreU(middle(band.luma.node_y, i), d, band.chroma.node_y.data() + pair * band.pitch + i);
    }
  }
}

// The longest blocks in one plane of the image; see Slot. (x, y) is the principal point.
struct LongestBlocks {
  explicit LongestBlocks(const Slot& slot)
      : outer(slot.longest_block), inner(slot.longest_inner_block), x(slot.cx), y(slot.cy), radius(slot.inner_radius) {}
  LongestBlocks in_chroma() const {
    LongestBlocks to = *this;
    to.outer /= 2, to.inner /= 2, to.radius /= 2;
    to.x = (x - 0.5f) / 2, to.y = (y - 0.5f) / 2;
    return to;
  }
  float outer, inner, x, y, radius;
};

// The first row of the window of a half-block, and the number of further rows that can be the upper row of a sample.
template <class V>
struct HalfRows {
  V first, steps;
};
template <class V>
HWY_INLINE HalfRows<V> rows_between(V from, V to, V bulge) {
  const V first = hn::Floor(hn::Sub(hn::Min(from, to), bulge));
  return {first, hn::Sub(hn::Floor(hn::Add(hn::Max(from, to), bulge)), first)};
}

// Decides how the samples of `n` blocks of one plane are read, and where their windows are, for a focal plane. The
// decision only uses the nodes at the edges of the blocks. `node_z` are the depths of the nodes. It is null for chroma,
// which is missing where luma is missing.
inline void place_blocks(const PlaneGeometry& plane, const LongestBlocks& longest, int n, const float* node_z,
                         PlanePositions& out) {
  const hn::CappedTag<float, kBlock> d;
  const hn::RebindToSigned<decltype(d)> di;
  const hn::RebindToUnsigned<decltype(d)> du;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto set = [&](float v) HWY_ATTR { return hn::Set(d, v); };
  const auto code = [&](hn::Mask<decltype(d)> when, FetchBits bit)
                        HWY_ATTR { return hn::IfThenElseZero(when, hn::Set(d, static_cast<float>(bit))); };
  const auto unit = set(static_cast<float>(1 << kPositionBits));
  const auto slack = set(kSlack);
  const auto largest_third = set(kLargestThird);
  const float *const node_x = out.node_x.data(), *const node_y = out.node_y.data();
  for (int i = 0; i < n; i += lanes) {
    const auto xa = hn::LoadU(d, node_x + i), x0 = hn::LoadU(d, node_x + i + 1), x1 = hn::LoadU(d, node_x + i + 2),
               xb = hn::LoadU(d, node_x + i + 3);
    const auto ya = hn::LoadU(d, node_y + i), y0 = hn::LoadU(d, node_y + i + 1), y1 = hn::LoadU(d, node_y + i + 2),
               yb = hn::LoadU(d, node_y + i + 3);
    const auto dx = hn::Sub(x1, x0), dy = hn::Sub(y1, y0);
    const auto sx = hn::Sub(hn::Sub(xb, x1), hn::Sub(x0, xa)), sy = hn::Sub(hn::Sub(yb, y1), hn::Sub(y0, ya));
    const auto third_x = hn::Abs(hn::Sub(hn::Sub(xb, xa), hn::Mul(set(3), dx)));
    const auto third_y = hn::Abs(hn::Sub(hn::Sub(yb, ya), hn::Mul(set(3), dy)));
    const auto at_x = [&](float t) HWY_ATTR { return hn::MulAdd(set(bessel(t)), sx, hn::MulAdd(set(t), dx, x0)); };
    const auto at_y = [&](float t) HWY_ATTR { return hn::MulAdd(set(bessel(t)), sy, hn::MulAdd(set(t), dy, y0)); };
    const auto last_x = at_x(plane.t_last), last_y = at_y(plane.t_last);
    const auto bulge_x = hn::MulAdd(hn::Abs(sx), set(1.f / 16), slack);
    const auto bulge_y = hn::MulAdd(hn::Abs(sy), set(1.f / 16), slack);
    const auto low_x = hn::Sub(hn::Min(x0, last_x), bulge_x), high_x = hn::Add(hn::Max(x0, last_x), bulge_x);
    const auto low_y = hn::Sub(hn::Min(y0, last_y), bulge_y), high_y = hn::Add(hn::Max(y0, last_y), bulge_y);

    // NaN fails every comparison and gets no bit.
    const auto squared_distance = [&](const auto x, const auto y) HWY_ATTR {
      const auto to_x = hn::Sub(x, set(longest.x)), to_y = hn::Sub(y, set(longest.y));
      return hn::MulAdd(to_x, to_x, hn::Mul(to_y, to_y));
    };
    const auto is_inner =
        hn::Lt(hn::Max(squared_distance(xa, ya), squared_distance(xb, yb)), set(longest.radius * longest.radius));
    const auto longest_block = hn::IfThenElse(is_inner, set(longest.inner), set(longest.outer));
    const auto smooth = hn::And(hn::And(hn::Lt(third_x, largest_third), hn::Lt(third_y, largest_third)),
                                hn::Lt(hn::Max(hn::Abs(dx), hn::Abs(dy)), longest_block));
    const auto inside =
        hn::And(hn::And(hn::Ge(low_x, set(0)), hn::Lt(high_x, set(plane.width - 1 - plane.border_columns))),
                hn::And(hn::Ge(low_y, set(0)), hn::Lt(high_y, set(plane.height - 1))));
    const auto good = hn::And(inside, smooth);
    auto fetch = code(good, kSampleBit);
    if (node_z) {
      const auto outside = hn::Or(hn::Or(hn::Lt(high_x, set(-0.5f)), hn::Gt(low_x, set(plane.width - 0.5f))),
                                  hn::Or(hn::Lt(high_y, set(-0.5f)), hn::Gt(low_y, set(plane.height - 0.5f))));
      // Depth is linear: samples are behind the camera if both ends of the block are.
      const auto behind =
          hn::And(hn::Le(hn::LoadU(d, node_z + i + 1), hn::Zero(d)), hn::Le(hn::LoadU(d, node_z + i + 2), hn::Zero(d)));
      const auto lost = hn::Or(behind, hn::And(outside, smooth));
      fetch = hn::IfThenElse(lost, code(lost, kLostBit), fetch);
    }

    const auto column = hn::Floor(low_x);
    auto row = hn::Floor(low_y), row_half = row;
    const auto half = hn::Floor(hn::Sub(at_x(plane.t_half), slack));
    if (plane.shuffles) {
      const auto reach = set(kWindow - 1);
      const auto rightmost = hn::Floor(hn::Add(at_x(plane.t_before_half), slack));
      const auto rises = hn::Gt(dx, hn::MulAdd(hn::Abs(sx), set(0.25f), set(1.f / 64)));
      const auto narrow =
          hn::And(hn::Lt(hn::Sub(rightmost, column), reach), hn::Lt(hn::Sub(hn::Floor(high_x), half), reach));
      // The fixed-point values for a whole block must also fit in 16 bits. They do not at two image pixels per view
      // pixel, although the samples of each half fit in its window.
      constexpr float kWithin16Bits = (1 << (16 - kPositionBits)) - 1;
      const auto fixed_fit = hn::And(hn::And(hn::Lt(dx, set(kWithin16Bits)), hn::Lt(hn::Abs(dy), set(8))),
                                     hn::And(hn::Lt(hn::Abs(sy), set(8)), hn::Lt(hn::Abs(sx), set(8))));
      const auto third = hn::Add(row, set(2));
      const auto readable =
          hn::Or(hn::Lt(third, set(plane.height - 1)),
                 hn::And(hn::Le(third, set(plane.height - 1)), hn::Le(hn::Add(half, set(kWindow)), set(plane.width))));
      const auto two_steps = hn::Lt(hn::Sub(hn::Floor(high_y), row), set(kFlatSteps - 0.5f));
      const auto fits = hn::And(good, hn::And(hn::And(rises, narrow), fixed_fit));
      const auto flat = hn::And(fits, hn::And(readable, two_steps));
      fetch = hn::Add(fetch, code(flat, kFlatBit));
      if (plane.slopes) {
        const auto rows = rows_between(y0, at_y(plane.t_before_half), bulge_y);
        const auto rows_half = rows_between(at_y(plane.t_half), last_y, bulge_y);
        row = hn::IfThenElse(flat, row, rows.first);
        row_half = hn::IfThenElse(flat, row, rows_half.first);
        const auto tall_readable = hn::Lt(hn::Max(row, row_half), set(plane.height - 1 - kSlopedSteps));
        const auto few_steps = hn::Lt(hn::Max(rows.steps, rows_half.steps), set(kSlopedSteps - 0.5f));
        const auto tall = hn::And(fits, hn::And(tall_readable, few_steps));
        fetch = hn::Add(fetch, code(tall, kTallBit));
      }
    }
    const auto to_half = hn::MulAdd(hn::Sub(row_half, row), set(256), hn::Sub(half, column));
    const auto fixed = [&](const auto v) HWY_ATTR { return to_low_bits(hn::Mul(v, unit)); };
    const auto pack = [&](const auto low, const auto high)
                          HWY_ATTR { return hn::Or(hn::And(low, hn::Set(du, 0xffff)), hn::ShiftLeft<16>(high)); };
    hn::StoreInterleaved4(pack(fixed(hn::Sub(x0, column)), fixed(dx)), pack(fixed(sx), fixed(hn::Sub(y0, row))),
                          pack(fixed(dy), fixed(sy)), pack(fixed(hn::Sub(x0, half)), to_low_bits(to_half)), du,
                          reinterpret_cast<uint32_t*>(out.window.data() + i));
    hn::StoreU(hn::Add(hn::Mul(hn::ConvertTo(di, row), hn::Set(di, plane.stride)), hn::ConvertTo(di, column)), di,
               out.corner.data() + i);
    hn::StoreU(hn::BitCast(di, hn::And(to_low_bits(fetch), hn::Set(du, 0xff))), di, out.fetch.data() + i);
  }
}

// Does the same as place_blocks() for interior rows, which need no tests, because all samples are visible and
// accurately interpolated. kSloped: windows are tall, and the second half of a luma block may begin in another row.
template <bool kSloped>
inline void place_interior_blocks(const PlaneGeometry& plane, int n, PlanePositions& out) {
  const hn::CappedTag<float, kBlock> d;
  const hn::RebindToSigned<decltype(d)> di;
  const hn::RebindToUnsigned<decltype(d)> du;
  const auto set = [&](float v) HWY_ATTR { return hn::Set(d, v); };
  const auto slack = set(kSlack), unit = set(static_cast<float>(1 << kPositionBits)), magic = set(kMagic);
  const float *const node_x = out.node_x.data(), *const node_y = out.node_y.data();
  for (int i = 0; i < n; i += static_cast<int>(hn::Lanes(d))) {
    const auto x0 = hn::LoadU(d, node_x + i + 1), x1 = hn::LoadU(d, node_x + i + 2);
    const auto y0 = hn::LoadU(d, node_y + i + 1), y1 = hn::LoadU(d, node_y + i + 2);
    const auto dx = hn::Sub(x1, x0), dy = hn::Sub(y1, y0);
    const auto sx = hn::Sub(hn::Sub(hn::LoadU(d, node_x + i + 3), x1), hn::Sub(x0, hn::LoadU(d, node_x + i)));
    const auto sy = hn::Sub(hn::Sub(hn::LoadU(d, node_y + i + 3), y1), hn::Sub(y0, hn::LoadU(d, node_y + i)));
    const auto column = hn::Floor(hn::Sub(x0, slack));
    const auto middle = hn::MulAdd(set(bessel(plane.t_half)), sx, hn::MulAdd(set(plane.t_half), dx, x0));
    const auto half = hn::Floor(hn::Sub(middle, slack));
    const auto at_y = [&](float t) HWY_ATTR { return hn::MulAdd(set(bessel(t)), sy, hn::MulAdd(set(t), dy, y0)); };
    const auto bulge = hn::MulAdd(hn::Abs(sy), set(1.f / 16), slack);
    const auto first_row = [&](const auto from, const auto to)
                               HWY_ATTR { return hn::Floor(hn::Sub(hn::Min(from, to), bulge)); };
    const bool two_rows = kSloped && plane.t_half > 0;
    const auto last_y = at_y(plane.t_last);
    const auto row = first_row(y0, two_rows ? at_y(plane.t_before_half) : last_y);
    auto to_half = hn::Sub(half, column);
    if (two_rows) to_half = hn::MulAdd(hn::Sub(first_row(at_y(plane.t_half), last_y), row), set(256), to_half);
    const auto fixed = [&](const auto v) HWY_ATTR { return hn::BitCast(du, hn::MulAdd(v, unit, magic)); };
    const auto pack = [&](const auto low, const auto high)
                          HWY_ATTR { return hn::Or(hn::And(low, hn::Set(du, 0xffff)), hn::ShiftLeft<16>(high)); };
    hn::StoreInterleaved4(pack(fixed(hn::Sub(x0, column)), fixed(dx)), pack(fixed(sx), fixed(hn::Sub(y0, row))),
                          pack(fixed(dy), fixed(sy)), pack(fixed(hn::Sub(x0, half)), to_low_bits(to_half)), du,
                          reinterpret_cast<uint32_t*>(out.window.data() + i));
    hn::StoreU(hn::ConvertTo(di, hn::MulAdd(row, set(static_cast<float>(plane.stride)), column)), di,
               out.corner.data() + i);
  }
}

// Decides how each pair of rows of a block is rendered: in the fastest way that is possible for all its planes.
inline void decide(bool i420, SlotBand& band) {
  for (int pair = 0; pair < kBandPairs; pair++) {
    const int32_t* const upper = band.luma.fetch.data() + 2 * pair * band.pitch;
    const int32_t* const lower = upper + band.pitch;
    const int32_t* const chroma = i420 ? band.chroma.fetch.data() + pair * band.pitch : upper;
    int32_t* __restrict const method = band.method.data() + pair * band.pitch;
    for (int i = 0; i < band.blocks; i++) {
      const int32_t luma = upper[i] & lower[i], common = luma & chroma[i];
      int32_t v = common & kSampleBit ? SlotBand::kSample : SlotBand::kProject;
      v = common & kTallBit ? SlotBand::kTall : v;
      v = common & kFlatBit ? SlotBand::kShuffle : v;
      method[i] = luma & kLostBit ? SlotBand::kAllMissing : v;
    }
  }
}

// Sets `flat` and `sloped`, see find_interior_rows() in sum_task.h.
inline void set_interior_rows(PixelFamily family, Slot& slot) {
  const ImageView& image = slot.image;
  if (family != PixelFamily::kI420 || image.family != family) return;
  if (!luma_geometry(slot, true).shuffles || !chroma_geometry(slot).shuffles) return;
  if (int64_t{image.height} * image.stride[0] >= 1 << 24) return;  // corners are computed in float
  const hn::CappedTag<float, kBlock> d;
  const auto set = [&](float v) HWY_ATTR { return hn::Set(d, v); };
  const int left = slot.rect.x0 / kBlock - 1, columns = (slot.rect.x1 + kBlock - 1) / kBlock - left + 2;
  const int top = slot.rect.y0 - kBlock, rows = (slot.rect.height() + kBlock - 1) / kBlock + 3;
  const ProjectionTerms terms = terms_at(slot, left * kBlock, top);
  const Projection projection(slot, terms);
  const int pitch = columns + kBlock;
  std::vector<float> x(static_cast<size_t>(pitch) * rows), y(x.size());
  std::vector<uint8_t> seen(rows);
  for (int j = 0; j < rows; j++) {
    auto all = hn::Eq(set(0), set(0));
    for (int i = 0; i < columns; i += static_cast<int>(hn::Lanes(d))) {
      hn::Vec<decltype(d)> px, py, z, reach;
      const auto column = hn::Add(hn::Iota(d, 0.f), set(static_cast<float>(i)));
      projection.project(d, hn::Mul(column, set(kBlock)), set(static_cast<float>(j * kBlock)), px, py, z, reach);
      const auto good = hn::And(hn::Gt(z, set(1e-3f)), hn::Le(reach, set(0.9f * slot.distortion.limit)));
      all = hn::And(all, hn::Or(hn::Ge(column, set(static_cast<float>(columns))), good));
      hn::StoreU(px, d, &x[static_cast<size_t>(j) * pitch + i]);
      hn::StoreU(py, d, &y[static_cast<size_t>(j) * pitch + i]);
    }
    seen[j] = hn::AllTrue(d, all);
  }
  // Margin for positions between the tested rows. Windows may extend into the next image row, but not beyond the last
  // row.
  constexpr float kRoom = 3;
  const bool slopes = luma_geometry(slot, true).slopes;
  const float right = static_cast<float>(image.width - 1) - kRoom;
  const float bottom = static_cast<float>(image.height) - (slopes ? 10.f : 8.f);
  const float inner = std::max(slot.inner_radius - 1, 0.f);
  const auto is_inner = [&](size_t at) {
    const float dx = x[at] - slot.cx, dy = y[at] - slot.cy;
    return dx * dx + dy * dy < inner * inner;
  };
  const auto longest_block = [&](size_t at, bool last) {
    const bool both = slopes && is_inner(at - 1) && is_inner(last ? at + 1 : at + 2);
    return std::min(1.7f * kBlock, both ? slot.longest_inner_block : slot.longest_block);
  };
  // Limits of a block: vertical pixels of the image from its left to its right edge, and second differences of
  // positions. The rows of a half, including their bulges, spread over at most 0.47 * 2.75 + 0.19 * 3 < 2 pixels with
  // the sloped limits.
  struct Limits {
    float slope, second;
  };
  constexpr Limits kFlat{.slope = 0.8f, .second = 0.75f}, kSloped{.slope = 2.75f, .second = 1.5f};
  // Returns whether the block to the right of a node can be rendered without tests.
  const auto interior = [&](int j, int i, const Limits& limits) {
    const size_t at = static_cast<size_t>(j) * pitch + i;
    const auto bends = [&](const std::vector<float>& v, size_t step) {
      return !(std::abs(v[at + step] - 2 * v[at] + v[at - step]) < limits.second);
    };
    if (!(x[at] > kRoom && x[at] < right && y[at] > kRoom && y[at] < bottom)) return false;
    if (bends(x, 1) || bends(y, 1) || bends(x, pitch) || bends(y, pitch)) return false;
    const float dx = x[at + 1] - x[at], dy = y[at + 1] - y[at];
    if (!(dx > 0.25f * kBlock && dx < longest_block(at, i + 2 >= columns) && std::abs(dy) < limits.slope)) return false;
    if (i + 2 >= columns) return true;
    const float third_x = x[at + 2] - x[at - 1] - 3 * dx, third_y = y[at + 2] - y[at - 1] - 3 * dy;
    return std::abs(third_x) < 0.5f * kLargestThird && std::abs(third_y) < 0.5f * kLargestThird;
  };
  // A loop instead of a function, so that the compiler inlines `interior`.
  for (const bool sloped : {false, true}) {
    if (sloped && !slopes) break;
    const Limits limits = sloped ? kSloped : kFlat;
    Slot::InteriorRows& found = sloped ? slot.sloped : slot.flat;
    int begin = 1;  // first row of nodes of the current range
    for (int j = 1; j + 1 < rows; j++) {
      bool good = seen[j - 1] && seen[j] && seen[j + 1];
      for (int i = 1; i + 1 < columns && good; i++) good = interior(j, i, limits);
      if (!good)
        begin = j + 1;
      else if ((j - begin) * kBlock >= found.y1 - found.y0)
        found = {top + begin * kBlock, top + j * kBlock + 1};
    }
  }
}

template <bool kSloped>
inline void place_interior(const Slot& slot, const PlaneGeometry& luma, int luma_entries, int chroma_entries,
                           SlotBand& band) {
  place_interior_blocks<kSloped>(luma, luma_entries, band.luma);
  place_chroma_nodes(band);
  place_interior_blocks<kSloped>(chroma_geometry(slot), chroma_entries, band.chroma);
}

// Computes a SlotBand for a focal plane: where the samples of the camera are in the band that begins at row `y`, and
// how they are read. The range of blocks in `band` must be set.
inline void place_plane(bool i420, const Slot& slot, int y, SlotBand& band) {
  lay_nodes(band.blocks + 3, band);
  band.method_pitch = band.pitch;
  band.mapped = false;
  project_nodes(slot, y, band);
  const int luma_entries = band.pitch * kBandRows - 3, chroma_entries = band.pitch * kBandPairs - 3;
  const PlaneGeometry luma = luma_geometry(slot, i420);
  const int from = std::max(y, slot.rect.y0), to = std::min(y + kBandRows, slot.rect.y1);
  band.interior = slot.flat.contain(from, to)     ? SlotBand::kShuffle
                  : slot.sloped.contain(from, to) ? SlotBand::kTall
                                                  : SlotBand::kProject;
  if (band.interior == SlotBand::kTall) return place_interior<true>(slot, luma, luma_entries, chroma_entries, band);
  if (band.interior == SlotBand::kShuffle) return place_interior<false>(slot, luma, luma_entries, chroma_entries, band);
  const LongestBlocks longest(slot);
  place_blocks(luma, longest, luma_entries, band.node_z.data(), band.luma);
  if (i420) {
    place_chroma_nodes(band);
    place_blocks(chroma_geometry(slot), longest.in_chroma(), chroma_entries, nullptr, band.chroma);
  }
  decide(i420, band);
}

#if HWY_TARGET != HWY_SCALAR

// Return the smaller or the larger value of the two halves of each block, in the lanes of both halves.
template <class V>
HWY_INLINE V least_of_block(V v) {
  return hn::Min(v, hn::Shuffle2301(v));
}
template <class V>
HWY_INLINE V most_of_block(V v) {
  return hn::Max(v, hn::Shuffle2301(v));
}

// Bounds of the samples of a half-block in the image, for a pair of rows in luma or RGB, or for their row in a chroma
// plane. They are NaN if the positions are unknown, so that every comparison fails and the slow path is used.
template <class D, class V = hn::Vec<D>>
struct CellPlace {
  V low_x, high_x, low_y, high_y;
  V column, width;     // left column of the windows, and number of columns that the samples span
  V last_row, height;  // larger first image row of the two windows, and most image rows that one spans
  HWY_INLINE auto is_outside(D d, const PlaneGeometry& plane) const {
    return hn::Or(hn::Or(hn::Lt(high_x, hn::Set(d, -0.5f)), hn::Gt(low_x, hn::Set(d, plane.width - 0.5f))),
                  hn::Or(hn::Lt(high_y, hn::Set(d, -0.5f)), hn::Gt(low_y, hn::Set(d, plane.height - 0.5f))));
  }
  // Returns the possible FetchBits. `widest` is the number of columns that fixed point can represent, and `tall` the
  // number of rows of a tall window that can be the upper row of a sample.
  HWY_INLINE auto fetch(D d, const PlaneGeometry& plane, float widest, float tall) const {
    const hn::RebindToSigned<D> di;
    const auto set = [d](float v) HWY_ATTR { return hn::Set(d, v); };
    const auto inside =
        hn::And(hn::And(hn::Ge(low_x, set(0)), hn::Lt(high_x, set(plane.width - 1 - plane.border_columns))),
                hn::And(hn::Ge(low_y, set(0)), hn::Lt(high_y, set(plane.height - 1))));
    const auto fits = hn::And(hn::Lt(width, set(widest)), hn::Lt(height, set(kWindow - 1)));
    const auto good = hn::And(inside, fits);
    const auto code = [&](hn::Mask<D> when, int v, auto otherwise)
                          HWY_ATTR { return hn::IfThenElse(hn::RebindMask(di, when), hn::Set(di, v), otherwise); };
    const auto out = code(good, kSampleBit, hn::Zero(di));
    if (!plane.shuffles) return out;
    const auto narrow = hn::And(good, hn::Lt(width, set(kWindow - 1)));
    // Windows extend into the next image row, which must exist.
    const auto rows = [&](float n) HWY_ATTR {
      return hn::And(hn::Lt(height, set(n)), hn::Lt(last_row, set(plane.height - 1 - n)));
    };
    const auto flat = code(hn::And(narrow, rows(kFlatSteps)), kFlatBit, out);
    return hn::Or(flat, code(hn::And(narrow, rows(tall)), kTallBit, hn::Zero(di)));
  }
};

// Computes the bounds of the samples in a pair of rows, for each half of a block, from the bounds in the two rows of
// nodes around the pair.
template <class D>
struct PairBounds {
  using V = hn::Vec<D>;
  struct Rows {
    V upper, lower;
  };
  Rows top, bottom;
  V upper_row, lower_row;  // first row of the windows of each row
  CellPlace<D> of_both;

  HWY_INLINE PairBounds(D d, const SurfaceBand& band, int pair, size_t i) {
    const int k = cell_of_pair(pair);
    const size_t upper = band.entry(k, i), lower = band.entry(k + 1, i);
    const auto slack_x = hn::LoadU(d, band.slack_x.data() + upper), slack_y = hn::LoadU(d, band.slack_y.data() + upper);
    const auto rows = [&](const std::vector<float>& of) HWY_ATTR {
      const auto from = hn::LoadU(d, of.data() + upper), step = hn::Sub(hn::LoadU(d, of.data() + lower), from);
      const auto at = hn::MulAdd(hn::Set(d, first_t(pair)), step, from);
      return Rows{at, hn::MulAdd(hn::Set(d, 1.f / kCell), step, at)};
    };
    const Rows left = rows(band.low_x), right = rows(band.high_x);
    top = rows(band.low_y), bottom = rows(band.high_y);
    top = {hn::Sub(top.upper, slack_y), hn::Sub(top.lower, slack_y)};
    bottom = {hn::Add(bottom.upper, slack_y), hn::Add(bottom.lower, slack_y)};
    of_both.low_x = hn::Sub(hn::Min(left.upper, left.lower), slack_x);
    of_both.high_x = hn::Add(hn::Max(right.upper, right.lower), slack_x);
    of_both.low_y = hn::Min(top.upper, top.lower);
    of_both.high_y = hn::Max(bottom.upper, bottom.lower);
    upper_row = hn::Floor(top.upper), lower_row = hn::Floor(top.lower);
    of_both.column = hn::Floor(of_both.low_x);
    of_both.width = hn::Sub(of_both.high_x, of_both.column);
    of_both.last_row = hn::Max(upper_row, lower_row);
    of_both.height = hn::Max(hn::Sub(bottom.upper, upper_row), hn::Sub(bottom.lower, lower_row));
  }

  // Returns the bounds in the chroma planes. Chroma sample k is at luma 2 k + 0.5, so it lies within the bounds of both
  // rows horizontally, and between the rows vertically.
  HWY_INLINE CellPlace<D> in_chroma(D d) const {
    const auto to_chroma = [&](V v, float slack)
                               HWY_ATTR { return hn::MulAdd(v, hn::Set(d, 0.5f), hn::Set(d, slack - 0.25f)); };
    const auto middle = [&](const Rows& of) HWY_ATTR { return hn::Mul(hn::Set(d, 0.5f), hn::Add(of.upper, of.lower)); };
    CellPlace<D> place;
    place.low_x = to_chroma(least_of_block(of_both.low_x), -kSlack);
    place.high_x = to_chroma(most_of_block(of_both.high_x), kSlack);
    place.low_y = to_chroma(least_of_block(middle(top)), -kSlack);
    place.high_y = to_chroma(most_of_block(middle(bottom)), kSlack);
    place.column = hn::Floor(place.low_x);
    place.width = hn::Sub(place.high_x, place.column);
    place.last_row = hn::Floor(place.low_y);
    place.height = hn::Sub(place.high_y, place.last_row);
    return place;
  }
};

// Decides how the pairs of rows of each block are rendered, and where their windows are, for a focal map. Sets
// band.method like decide().
inline void decide_cells(const Slot& slot, bool i420, SlotBand& band) {
  const hn::CappedTag<float, kBlock> d;
  const hn::RebindToSigned<decltype(d)> di;
  const hn::RebindToUnsigned<decltype(d)> du;
  const hn::Half<decltype(di)> d_blocks;
  using VI = hn::Vec<decltype(di)>;
  SurfaceBand& out = band.surface;
  const size_t halves = 2 * static_cast<size_t>(band.blocks), pitch = out.pitch;
  const PlaneGeometry luma = luma_geometry(slot, i420);
  const PlaneGeometry chroma = i420 ? chroma_geometry(slot) : luma;
  const auto store_blocks = [&](VI v, int32_t* to) HWY_ATTR {
    hn::StoreU(hn::LowerHalf(d_blocks, hn::ConcatEven(di, v, v)), d_blocks, to);
  };
  const auto corner = [&](const PlaneGeometry& plane, VI column, VI row) HWY_ATTR {
    return hn::Add(hn::Mul(row, hn::Set(di, plane.stride)), hn::Mul(column, hn::Set(di, plane.pixel_bytes)));
  };
  // Origin of a window in fixed point: integer pixels and fractions of 2^-kBits.
  const auto origin = [&](auto bits, VI column, VI row, uint32_t more) HWY_ATTR {
    constexpr int kBits = decltype(bits)::value;
    const auto x = hn::And(hn::ShiftLeft<kBits>(hn::BitCast(du, column)), hn::Set(du, 0xffff));
    return hn::Or(hn::Or(x, hn::ShiftLeft<16 + kBits>(hn::BitCast(du, row))), hn::Set(du, more));
  };
  const auto code = [&](int v) HWY_ATTR { return hn::Set(di, v); };
  for (size_t i = 0; i < halves; i += hn::Lanes(d)) {
    auto interior = hn::Zero(di);
    for (int pair = 0; pair < kBandPairs; pair++) {
      const PairBounds<decltype(d)> place(d, out, pair, i);
      const auto& at = place.of_both;
      const auto lost = hn::IfThenElseZero(hn::RebindMask(di, at.is_outside(d, luma)), code(SlotBand::kAllMissing));
      const auto missing_block = hn::And(lost, hn::Shuffle2301(lost));
      auto fetch = at.fetch(d, luma, 2 * kWindow - 1, kTallSteps);
      const size_t row = static_cast<size_t>(2 * pair) * pitch + i;
      const auto in_column = hn::ConvertTo(di, at.column), in_upper = hn::ConvertTo(di, place.upper_row),
                 in_lower = hn::ConvertTo(di, place.lower_row);
      hn::StoreU(corner(luma, in_column, in_upper), di, out.luma_corner.data() + row);
      hn::StoreU(corner(luma, in_column, in_lower), di, out.luma_corner.data() + row + pitch);
      constexpr std::integral_constant<int, kPositionBits> kLuma;
      hn::StoreU(origin(kLuma, in_column, in_upper, 0), du, out.luma_origin.data() + row);
      hn::StoreU(origin(kLuma, in_column, in_lower, 0), du, out.luma_origin.data() + row + pitch);
      if (i420) {
        const CellPlace<decltype(d)> in_chroma = place.in_chroma(d);
        fetch = hn::And(fetch, in_chroma.fetch(d, chroma, kWindow - 1, kTallChromaSteps));
        const auto in_chroma_column = hn::ConvertTo(di, in_chroma.column),
                   in_chroma_row = hn::ConvertTo(di, in_chroma.last_row);
        const size_t block = (static_cast<size_t>(pair) * pitch + i) / 2;
        store_blocks(corner(chroma, in_chroma_column, in_chroma_row), out.chroma_corner.data() + block);
        // Chroma sample k in luma pixels: 2 k + 0.5.
        constexpr std::integral_constant<int, kPositionBits + 1> kChroma;
        constexpr uint32_t kHalfPixel = 1 << (kPositionBits - 1);
        store_blocks(hn::BitCast(di, origin(kChroma, in_chroma_column, in_chroma_row, kHalfPixel << 16 | kHalfPixel)),
                     reinterpret_cast<int32_t*>(out.chroma_origin.data()) + block);
      }
      const auto common = hn::And(fetch, hn::Shuffle2301(fetch));
      const auto when = [&](int least, int v, auto otherwise)
                            HWY_ATTR { return hn::IfThenElse(hn::Gt(common, code(least - 1)), code(v), otherwise); };
      const auto method = when(kFlatBit, SlotBand::kShuffle,
                               when(kTallBit, SlotBand::kTall, when(kSampleBit, SlotBand::kSample, missing_block)));
      store_blocks(method, band.method.data() + pair * band.method_pitch + i / 2);
      const auto shuffled = hn::Eq(method, code(SlotBand::kShuffle));
      interior = hn::Or(interior, hn::IfThenElseZero(shuffled, code(1 << pair)));
    }
    store_blocks(interior, out.interior_pairs.data() + i / 2);
  }
}

// Computes a SlotBand for a focal map with nodes kCell pixels apart; see place_surface().
inline void place_cells(const Slot& slot, bool i420, int y, bool follows, const CellNodes& inverse, CellWork& work,
                        SlotBand& band) {
  SurfaceBand& out = band.surface;
  work.resize(out.pitch);
  const size_t halves = 2 * static_cast<size_t>(band.blocks), first = 2 * static_cast<size_t>(band.first_block);
  const int ready = follows ? kCellRows - kBandRows / kCell : 0;  // rows of nodes
  const int ready_cells = std::max(ready - 1, 0);
  out.first_row = (y / kCell + kCellRows - 1) % kCellRows;
  project_cells(slot, inverse, first, halves + 1, y, ready, out, work);
  bound_cell_errors(slot, inverse, first, halves + 1, ready_cells, out, work.error_bound);
  for (int k = ready; k < kCellRows; k++) fix_nodes(work, k, halves, out);
  for (int k = ready_cells; k + 1 < kCellRows; k++) {
    fix_cells(work, k, halves, out);
    if (slot.edges) exclude_edges(*slot.edges, y / kCell + k, k, first, halves, out);
  }
  decide_cells(slot, i420, band);
}

#else

// Without vector instructions, every sample takes the slow path.
inline void place_cells(const Slot&, bool, int, bool, const CellNodes&, CellWork&, SlotBand& band) {
  std::ranges::fill(band.method, SlotBand::kProject);
  std::ranges::fill(band.surface.interior_pairs, 0);
}

#endif

// Computes a SlotBand for a focal map: where the samples of the camera are in the band that begins at row `y`, and how
// they are read. The range of blocks in `band` must be set. If `follows` is true, `band` contains the preceding band,
// and its last nodes are reused. `inverse` is null if the nodes of the map are not kCell pixels apart; every sample is
// then projected.
inline void place_surface(bool i420, const Slot& slot, int y, bool follows, const CellNodes* inverse, CellWork& work,
                          SlotBand& band) {
  SurfaceBand& out = band.surface;
  band.interior = SlotBand::kProject;
  band.mapped = true;
  out.resize(band.blocks);
  band.method_pitch = out.pitch / 2;
  band.method.resize(std::max(band.method.size(), static_cast<size_t>(band.method_pitch) * kBandPairs));
  if (inverse) return place_cells(slot, i420, y, follows, *inverse, work, band);
  std::ranges::fill(band.method, SlotBand::kProject);
  std::ranges::fill(out.interior_pairs, 0);
}

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
