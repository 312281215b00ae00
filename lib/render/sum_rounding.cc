// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/sum_rounding.h"

#include <vector>

namespace lf {

Fragment rounded_fragment(CameraIndex camera, const ConstSumPlanes& sums) {
  const Rect& rect = sums.rect;
  const int w = rect.width(), h = rect.height();
  Fragment out{camera, sums.family, rect, {}, {}};
  out.pixels.resize(packed_size(sums.family, w, h));
  uint8_t* to = out.pixels.data();
  if (sums.family == PixelFamily::kRgb) {
    std::vector<uint8_t> row(w);
    for (int y = 0; y < h; y++, to += 3 * static_cast<size_t>(w))
      for (int c = 0; c < 3; c++) {
        round_row(row.data(), sums.plane[c] + y * sums.stride[c], w);
        for (int x = 0; x < w; x++) to[3 * x + c] = row[x];
      }
  } else {
    for (int y = 0; y < h; y++, to += w) round_row(to, sums.plane[0] + y * sums.stride[0], w);
    for (int c = 1; c < 3; c++)
      for (int y = 0; y < chroma_size(h); y++, to += chroma_size(w))
        round_chroma_row(to, sums.plane[c] + y * sums.stride[c], chroma_size(w), 0);
  }
  if (!sums.lost) return out;
  out.lost.resize(static_cast<size_t>(w) * h);
  for (int y = 0; y < h; y++)
    round_lost_row(&out.lost[static_cast<size_t>(y) * w], sums.lost + y * sums.lost_stride, w);
  if (std::ranges::all_of(out.lost, [](uint8_t v) { return v == 0; })) out.lost.clear();
  return out;
}

}  // namespace lf
