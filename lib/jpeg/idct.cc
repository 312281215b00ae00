// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/idct.h"

#include <algorithm>
#include <cstring>

// Vectors of unknown size cannot be stored in arrays. Arm machines with SVE have NEON as well.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "jpeg/idct.cc"
#include <hwy/foreach_target.h>  // must precede highway.h
#include <hwy/highway.h>

// Factors of one pass, with 13 fraction bits. Inputs 0, 2, 4, 6 give the even half of outputs 0..3, and inputs 1, 3, 5,
// 7 the odd half. Output i is even + odd, and output 7 - i is even - odd. The sums equal the butterflies of jidctint.c,
// because integer sums are exact in any order. They do not overflow for 16-bit inputs.
#ifndef LF_JPEG_IDCT_SUMS
#define LF_JPEG_IDCT_SUMS
namespace lf::jpeg {
inline constexpr int16_t kEven[4][4] = {
    {8192, 10703, 8192, 4433}, {8192, 4433, -8192, -10704}, {8192, -4433, -8192, 10704}, {8192, -10703, 8192, -4433}};
inline constexpr int16_t kOdd[4][4] = {
    {11363, 9633, 6437, 2260}, {9633, -2259, -11362, -6436}, {6437, -11362, 2261, 9633}, {2260, -6436, 9633, -11363}};
// Right shift of each pass. The first pass leaves 2 fraction bits. The second leaves none, and also removes the DCT's
// factor of 8.
inline constexpr int kShift[2] = {13 - 2, 13 + 2 + 3};
// Rounding and, in the second pass, the offset of 128.
inline constexpr int32_t kBias[2] = {1 << 10, (1 << 17) + (128 << 18)};
}  // namespace lf::jpeg
#endif

HWY_BEFORE_NAMESPACE();
namespace lf::jpeg::HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR

template <int kPass>
void transform(const int16_t* in, int16_t* out) {
  for (int x = 0; x < 8; x++)
    for (int i = 0; i < 4; i++) {
      int32_t even = kBias[kPass], odd = 0;
      for (int k = 0; k < 4; k++) {
        even += kEven[i][k] * in[16 * k + x];
        odd += kOdd[i][k] * in[16 * k + 8 + x];
      }
      const auto clamped = [](int32_t v) { return static_cast<int16_t>(std::clamp(v, -32768, 32767)); };
      out[8 * x + i] = clamped((even + odd) >> kShift[kPass]);
      out[8 * x + 7 - i] = clamped((even - odd) >> kShift[kPass]);
    }
}

void idct(const int16_t* block, unsigned, uint8_t* out, ptrdiff_t stride) {
  int16_t natural[64], work[64];
  for (int i = 0; i < 64; i++) natural[i] = block[idct_index(i / 8, i % 8)];
  transform<0>(natural, work);
  transform<1>(work, natural);
  for (int i = 0; i < 64; i++) out[i / 8 * stride + i % 8] = static_cast<uint8_t>(std::clamp<int>(natural[i], 0, 255));
}

#else

namespace hn = hwy::HWY_NAMESPACE;

using Wide = hn::CappedTag<int32_t, 8>;  // eight columns, or four with short vectors
using Pairs = hn::Repartition<int16_t, Wide>;
using VWide = hn::Vec<Wide>;
using VPairs = hn::Vec<Pairs>;
constexpr bool kShort = HWY_MAX_BYTES < 32;

HWY_INLINE VWide multiply_add(VPairs pairs, int16_t a, int16_t b) {
  const Wide d;
  const auto factors = static_cast<uint32_t>(static_cast<uint16_t>(a)) | static_cast<uint32_t>(b) << 16;
  auto odd = hn::Zero(d);
  const auto sum = hn::ReorderWidenMulAccumulate(
      d, pairs, hn::BitCast(Pairs(), hn::Set(d, static_cast<int32_t>(factors))), hn::Zero(d), odd);
  return hn::RearrangeToOddPlusEven(sum, odd);
}

// Computes one pass over inputs 0 and 2, 1 and 3, 4 and 6, 5 and 7 of each lane. Inputs 4 to 7 are zero with kLow.
template <int kPass, bool kLow>
HWY_INLINE void transform(VPairs in02, VPairs in13, VPairs in46, VPairs in57, VWide (&out)[8]) {
  for (int i = 0; i < 4; i++) {
    auto even = hn::Add(multiply_add(in02, kEven[i][0], kEven[i][1]), hn::Set(Wide(), kBias[kPass]));
    auto odd = multiply_add(in13, kOdd[i][0], kOdd[i][1]);
    if constexpr (!kLow) {
      even = hn::Add(even, multiply_add(in46, kEven[i][2], kEven[i][3]));
      odd = hn::Add(odd, multiply_add(in57, kOdd[i][2], kOdd[i][3]));
    }
    out[i] = hn::ShiftRight<kShift[kPass]>(hn::Add(even, odd));
    out[7 - i] = hn::ShiftRight<kShift[kPass]>(hn::Sub(even, odd));
  }
}

// Converts rows of four columns per 128-bit block, in the order 0 2 1 3, to pairs of columns 0 and 2 (a) and 1 and 3
// (b), each with four rows. Values beyond 16 bits, which only damaged blocks have, are clamped.
HWY_INLINE void transpose(VWide row0, VWide row1, VWide row2, VWide row3, VPairs& a, VPairs& b) {
  const hn::Repartition<uint32_t, Wide> d32;
  const hn::Repartition<uint64_t, Wide> d64;
  const auto rows02 = hn::BitCast(d32, hn::ReorderDemote2To(Pairs(), row0, row2));
  const auto rows13 = hn::BitCast(d32, hn::ReorderDemote2To(Pairs(), row1, row3));
  const auto rows01 = hn::BitCast(d64, hn::InterleaveLower(d32, rows02, rows13));
  const auto rows23 = hn::BitCast(d64, hn::InterleaveUpper(d32, rows02, rows13));
  a = hn::BitCast(Pairs(), hn::InterleaveLower(d64, rows01, rows23));
  b = hn::BitCast(Pairs(), hn::InterleaveUpper(d64, rows01, rows23));
}

HWY_INLINE void store_rows(const VWide (&columns)[8], uint8_t* out, ptrdiff_t stride) {
  const Pairs d;
  VPairs both[4];  // columns i and i + 4 of four rows
  for (int i = 0; i < 4; i++) {
    both[i] = hn::ReorderDemote2To(d, columns[i], columns[i + 4]);
    both[i] = hn::Min(hn::Max(both[i], hn::Zero(d)), hn::Set(d, 255));
  }
  const auto columns01 = hn::Or(both[0], hn::ShiftLeft<8>(both[1]));
  const auto columns23 = hn::Or(both[2], hn::ShiftLeft<8>(both[3]));
  const hn::Repartition<uint32_t, Wide> d32;
  const auto left = hn::BitCast(d32, hn::InterleaveLower(d, columns01, columns23));
  const auto right = hn::BitCast(d32, hn::InterleaveUpper(d, columns01, columns23));
  alignas(32) uint32_t rows[2][8];
  hn::Store(hn::InterleaveLower(d32, left, right), d32, rows[0]);
  hn::Store(hn::InterleaveUpper(d32, left, right), d32, rows[1]);
  for (int y = 0; y < (kShort ? 4 : 8); y++) std::memcpy(out + y * stride, &rows[y / 2 % 2][y / 4 * 4 + y % 2 * 2], 8);
}

template <bool kLow>
HWY_INLINE void transform_block(const int16_t* block, uint8_t* out, ptrdiff_t stride) {
  const Pairs d;
  VWide v[8];
#if HWY_MAX_BYTES >= 32
  VPairs upper_a, upper_b, lower_a, lower_b;  // rows 0..3 and 4..7; the right block has columns 4 to 7
  transform<0, kLow>(hn::Load(d, block), hn::Load(d, block + 16), hn::Load(d, block + 32), hn::Load(d, block + 48), v);
  transpose(v[0], v[1], v[2], v[3], upper_a, upper_b);
  transpose(v[4], v[5], v[6], v[7], lower_a, lower_b);
  transform<1, kLow>(hn::ConcatLowerLower(d, lower_a, upper_a), hn::ConcatLowerLower(d, lower_b, upper_b),
                     hn::ConcatUpperUpper(d, lower_a, upper_a), hn::ConcatUpperUpper(d, lower_b, upper_b), v);
  store_rows(v, out, stride);
#else
  VPairs a[2][2], b[2][2];  // [left, right][upper, lower]
  for (int x = 0; x < 2; x++) {
    const int16_t* const half = block + 8 * x;
    transform<0, kLow>(hn::Load(d, half), hn::Load(d, half + 16), hn::Load(d, half + 32), hn::Load(d, half + 48), v);
    transpose(v[0], v[1], v[2], v[3], a[x][0], b[x][0]);
    transpose(v[4], v[5], v[6], v[7], a[x][1], b[x][1]);
  }
  for (int y = 0; y < 2; y++) {
    transform<1, kLow>(a[0][y], b[0][y], a[1][y], b[1][y], v);
    store_rows(v, out + 4 * y * stride, stride);
  }
#endif
}

void idct(const int16_t* block, unsigned last, uint8_t* out, ptrdiff_t stride) {
  if (last < 10)  // all in the first four rows and columns
    transform_block<true>(block, out, stride);
  else
    transform_block<false>(block, out, stride);
}

#endif

}  // namespace lf::jpeg::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lf::jpeg {

HWY_EXPORT(idct);

void idct(const int16_t* block, unsigned last, uint8_t* out, ptrdiff_t stride) {
  if (last > 0) {
    HWY_DYNAMIC_DISPATCH(idct)(block, last, out, stride);
    return;
  }
  const int sample = std::clamp(((block[0] + 4) >> 3) + 128, 0, 255);
  for (int y = 0; y < 8; y++) std::memset(out + y * stride, sample, 8);
}

}  // namespace lf::jpeg
#endif
