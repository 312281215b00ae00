// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/idct.h"

#include <algorithm>
#include <cstring>

// Scalable vectors can't be kept in arrays; Arm machines have NEON as well.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "jpeg/idct.cc"
#include <hwy/foreach_target.h>  // has to precede highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lf::jpeg::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Wide = hn::CappedTag<int32_t, 8>;  // eight columns at once, four where vectors are short, one without vectors
using VWide = hn::Vec<Wide>;

HWY_INLINE VWide multiply(VWide v, int32_t constant) { return hn::Mul(v, hn::Set(Wide(), constant)); }

// One pass of Loeffler, Ligtenberg and Moschytz' algorithm in jidctint.c's order, in each lane: 13 bits of fraction,
// which `kShift` takes away again, rounding.
template <int kShift>
HWY_INLINE void transform(VWide (&v)[8]) {
  const auto even = multiply(hn::Add(v[2], v[6]), 4433);
  const auto t2 = hn::Add(even, multiply(v[6], -15137)), t3 = hn::Add(even, multiply(v[2], 6270));
  const auto t0 = hn::ShiftLeft<13>(hn::Add(v[0], v[4])), t1 = hn::ShiftLeft<13>(hn::Sub(v[0], v[4]));
  const auto rounding = hn::Set(Wide(), 1 << (kShift - 1));
  const auto a0 = hn::Add(hn::Add(t0, t3), rounding), a3 = hn::Add(hn::Sub(t0, t3), rounding);
  const auto a1 = hn::Add(hn::Add(t1, t2), rounding), a2 = hn::Add(hn::Sub(t1, t2), rounding);

  const auto z3 = hn::Add(v[7], v[3]), z4 = hn::Add(v[5], v[1]);
  const auto z5 = multiply(hn::Add(z3, z4), 9633);
  const auto m1 = multiply(hn::Add(v[7], v[1]), -7373), m2 = multiply(hn::Add(v[5], v[3]), -20995);
  const auto m3 = hn::Add(multiply(z3, -16069), z5), m4 = hn::Add(multiply(z4, -3196), z5);
  const auto b0 = hn::Add(multiply(v[7], 2446), hn::Add(m1, m3));
  const auto b1 = hn::Add(multiply(v[5], 16819), hn::Add(m2, m4));
  const auto b2 = hn::Add(multiply(v[3], 25172), hn::Add(m2, m3));
  const auto b3 = hn::Add(multiply(v[1], 12299), hn::Add(m1, m4));

  v[0] = hn::ShiftRight<kShift>(hn::Add(a0, b3));
  v[7] = hn::ShiftRight<kShift>(hn::Sub(a0, b3));
  v[1] = hn::ShiftRight<kShift>(hn::Add(a1, b2));
  v[6] = hn::ShiftRight<kShift>(hn::Sub(a1, b2));
  v[2] = hn::ShiftRight<kShift>(hn::Add(a2, b1));
  v[5] = hn::ShiftRight<kShift>(hn::Sub(a2, b1));
  v[3] = hn::ShiftRight<kShift>(hn::Add(a3, b0));
  v[4] = hn::ShiftRight<kShift>(hn::Sub(a3, b0));
}

#if HWY_TARGET == HWY_SCALAR

template <int kShift>
void transform_columns(const int16_t* in, int16_t* transposed) {
  for (int x = 0; x < 8; x++) {
    VWide v[8];
    for (int i = 0; i < 8; i++) v[i] = hn::Set(Wide(), in[8 * i + x]);
    transform<kShift>(v);
    for (int i = 0; i < 8; i++)
      transposed[8 * x + i] = static_cast<int16_t>(std::clamp(hn::GetLane(v[i]), -32768, 32767));
  }
}

void idct(const int16_t* block, uint8_t* out, ptrdiff_t stride) {
  int16_t work[64], samples[64];
  transform_columns<13 - 2>(block, work);
  transform_columns<13 + 2 + 3>(work, samples);
  for (int i = 0; i < 64; i++) out[i / 8 * stride + i % 8] = static_cast<uint8_t>(std::clamp(samples[i] + 128, 0, 255));
}

#else

using Row = hn::FixedTag<int16_t, 8>;
using VRow = hn::Vec<Row>;

// The same over eight rows of 16 bits; what does not fit them, as happens in damaged blocks alone, is clamped.
template <int kShift>
HWY_INLINE void transform_rows(VRow (&rows)[8]) {
  VWide v[8];
#if HWY_MAX_BYTES >= 32
  for (int i = 0; i < 8; i++) v[i] = hn::PromoteTo(Wide(), rows[i]);
  transform<kShift>(v);
  for (int i = 0; i < 8; i++) rows[i] = hn::DemoteTo(Row(), v[i]);
#else
  const hn::Half<Row> half;
  hn::Vec<hn::Half<Row> > left[8];
  for (int i = 0; i < 8; i++) v[i] = hn::PromoteTo(Wide(), hn::LowerHalf(half, rows[i]));
  transform<kShift>(v);
  for (int i = 0; i < 8; i++) left[i] = hn::DemoteTo(half, v[i]);
  for (int i = 0; i < 8; i++) v[i] = hn::PromoteTo(Wide(), hn::UpperHalf(half, rows[i]));
  transform<kShift>(v);
  for (int i = 0; i < 8; i++) rows[i] = hn::Combine(Row(), hn::DemoteTo(half, v[i]), left[i]);
#endif
}

HWY_INLINE void transpose(VRow (&r)[8]) {
  const Row d;
  // Three times the same perfect shuffle of the rows' index and the columns'.
  for (int pass = 0; pass < 3; pass++) {
    VRow s[8];
    for (int i = 0; i < 4; i++) {
      s[2 * i] = hn::InterleaveLower(d, r[i], r[i + 4]);
      s[2 * i + 1] = hn::InterleaveUpper(d, r[i], r[i + 4]);
    }
    for (int i = 0; i < 8; i++) r[i] = s[i];
  }
}

void idct(const int16_t* block, uint8_t* out, ptrdiff_t stride) {
  const Row d;
  VRow rows[8];
  for (int i = 0; i < 8; i++) rows[i] = hn::Load(d, block + 8 * i);
  transform_rows<13 - 2>(rows);  // columns; two bits of fraction stay
  transpose(rows);
  transform_rows<13 + 2 + 3>(rows);  // rows; with the DCT's factor of 8
  transpose(rows);
  const hn::FixedTag<uint8_t, 8> bytes;
  for (int i = 0; i < 8; i++)
    hn::StoreU(hn::DemoteTo(bytes, hn::SaturatedAdd(rows[i], hn::Set(d, 128))), bytes, out + i * stride);
}

#endif

}  // namespace lf::jpeg::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lf::jpeg {

HWY_EXPORT(idct);

void idct(const int16_t* block, uint8_t* out, ptrdiff_t stride) { HWY_DYNAMIC_DISPATCH(idct)(block, out, stride); }

void idct_dc(int dc, uint8_t* out, ptrdiff_t stride) {
  const int sample = std::clamp(((dc + 4) >> 3) + 128, 0, 255);
  for (int y = 0; y < 8; y++) std::memset(out + y * stride, sample, 8);
}

}  // namespace lf::jpeg
#endif
