// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/sum_planes.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/sum_planes.cc"
#include <hwy/foreach_target.h>  // must precede highway.h
#include <hwy/highway.h>

#include "base/for_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lf::HWY_NAMESPACE {

// Rounds to the nearest level, as unsigned or signed bytes. Values that saturate here exceed 255 anyway.
template <typename Byte, class D>
HWY_INLINE auto rounded(D d, const int16_t* sum) {
  const auto half = hn::Set(d, 1 << (kSumFractionBits - 1));
  const auto level = hn::ShiftRight<kSumFractionBits>(hn::SaturatedAdd(hn::LoadU(d, sum), half));
  return hn::DemoteTo(hn::Rebind<Byte, D>(), level);
}

void round_levels(uint8_t* HWY_RESTRICT out, const int16_t* HWY_RESTRICT sum, int n) {
  for_lanes<int16_t>(n, [&](auto d, int i) HWY_ATTR {
    hn::StoreU(rounded<uint8_t>(d, sum + i), hn::Rebind<uint8_t, decltype(d)>(), out + i);
  });
}

void round_signed_levels(uint8_t* HWY_RESTRICT out, const int16_t* HWY_RESTRICT sum, int n, uint8_t offset) {
  for_lanes<int16_t>(n, [&](auto d, int i) HWY_ATTR {
    const hn::Rebind<uint8_t, decltype(d)> d8;
    const auto level = hn::BitCast(d8, rounded<int8_t>(d, sum + i));
    hn::StoreU(hn::Add(level, hn::Set(d8, offset)), d8, out + i);
  });
}

// `plane` is in the byte order of a pixel, and the fourth plane may be null.
void round_interleaved(uint8_t* HWY_RESTRICT out, int pixel_stride, const int16_t* const plane[4], int n) {
  for_lanes<int16_t>(n, [&](auto d, int i) HWY_ATTR {
    const hn::Rebind<uint8_t, decltype(d)> d8;
    const auto opaque = hn::Set(d8, 255);
    const auto level = [&](int c) HWY_ATTR { return plane[c] ? rounded<uint8_t>(d, plane[c] + i) : opaque; };
    if constexpr (hn::MaxLanes(d) == 1) {
      for (int c = 0; c < pixel_stride; c++) out[pixel_stride * i + c] = hn::GetLane(level(c));
    } else if (pixel_stride == 3) {
      hn::StoreInterleaved3(level(0), level(1), level(2), d8, out + 3 * i);
    } else {
      hn::StoreInterleaved4(level(0), level(1), level(2), level(3), d8, out + 4 * i);
    }
  });
}

}  // namespace lf::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lf {

HWY_EXPORT(round_levels);
HWY_EXPORT(round_signed_levels);
HWY_EXPORT(round_interleaved);

void round_row(uint8_t* out, const int16_t* sum, int n) { HWY_DYNAMIC_DISPATCH(round_levels)(out, sum, n); }

void round_chroma_row(uint8_t* out, const int16_t* sum, int n, uint8_t offset) {
  HWY_DYNAMIC_DISPATCH(round_signed_levels)(out, sum, n, offset);
}

void round_rgb_row(uint8_t* out, const RgbLayout& layout, const int16_t* r, const int16_t* g, const int16_t* b, int n) {
  const int16_t* plane[4] = {};
  plane[layout.r] = r;
  plane[layout.g] = g;
  plane[layout.b] = b;
  HWY_DYNAMIC_DISPATCH(round_interleaved)(out, layout.pixel_stride, plane, n);
}

Fragment rounded_fragment(const ConstSumPlanes& sums) {
  const Rect& rect = sums.rect;
  const int w = rect.width(), h = rect.height();
  const auto row = [&sums](int c, int y) { return sums.plane[c] + y * sums.stride[c]; };
  Fragment out{sums.family, rect, {}, {}};
  out.pixels.resize(packed_size(sums.family, w, h));
  uint8_t* to = out.pixels.data();
  if (sums.family == PixelFamily::kRgb) {
    for (int y = 0; y < h; y++, to += 3 * static_cast<size_t>(w))
      round_rgb_row(to, RgbLayout{}, row(0, y), row(1, y), row(2, y), w);
  } else {
    for (int y = 0; y < h; y++, to += w) round_row(to, row(0, y), w);
    for (int c = 1; c < 3; c++)
      for (int y = 0; y < chroma_size(h); y++, to += chroma_size(w)) round_chroma_row(to, row(c, y), chroma_size(w), 0);
  }
  if (!sums.lost) return out;
  out.lost.resize(static_cast<size_t>(w) * h);
  uint8_t any = 0;
  for (int y = 0; y < h; y++)
    for (int x = 0; x < w; x++)
      any |= out.lost[static_cast<size_t>(y) * w + x] = round_missing(sums.lost[y * sums.missing_stride + x]);
  if (any == 0) out.lost.clear();
  return out;
}

}  // namespace lf
#endif
