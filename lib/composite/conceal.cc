// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/conceal.h"

#include <algorithm>

#include "composite/resolve.h"

namespace lf {
namespace {

constexpr int kNone = kLostOne / 8, kFull = kLostOne / 4;  // weight left
constexpr int kMixBits = 8;

// Share of the picture before, 0 to 1 << kMixBits.
int share_before(int lost) {
  const int left = kLostOne - std::min(lost, kLostOne);
  if (left >= kFull) return 0;
  return ((kFull - std::max(left, kNone)) << kMixBits) / (kFull - kNone);
}

void mix(uint8_t& value, uint8_t before, int share) {
  value = static_cast<uint8_t>(value + (((before - value) * share + (1 << (kMixBits - 1))) >> kMixBits));
}

}  // namespace

void conceal(const ConstSumPlanes& sum, const ImageView& before, uint8_t* const plane[3], const ptrdiff_t stride[3]) {
  if (!sum.lost) return;
  const int width = sum.rect.width(), height = sum.rect.height();
  const int bytes = sum.family == PixelFamily::kRgb ? before.layout.pixel_stride : 1;
  for (int y = 0; y < height; y++) {
    const uint16_t* lost = sum.lost + y * sum.lost_stride;
    const uint8_t* from = before.plane[0] + y * before.stride[0];
    uint8_t* to = plane[0] + y * stride[0];
    for (int x = 0; x < width; x++) {
      const int share = share_before(lost[x]);
      if (share == 0) continue;
      for (int i = x * bytes; i < (x + 1) * bytes; i++) mix(to[i], from[i], share);
    }
  }
  if (sum.family != PixelFamily::kI420) return;
  const int step = chroma_step(plane), step_before = chroma_step(before.plane);
  for (int cy = 0; cy < chroma_size(height); cy++)
    for (int cx = 0; cx < chroma_size(width); cx++) {
      const int x1 = std::min(2 * cx + 1, width - 1), y1 = std::min(2 * cy + 1, height - 1);
      const uint16_t *top = sum.lost + 2 * cy * sum.lost_stride, *bottom = sum.lost + y1 * sum.lost_stride;
      const int share = share_before((top[2 * cx] + top[x1] + bottom[2 * cx] + bottom[x1]) / 4);
      if (share == 0) continue;
      for (int c = 1; c < 3; c++)
        mix(plane[c][cy * stride[c] + step * cx], before.plane[c][cy * before.stride[c] + step_before * cx], share);
    }
}

}  // namespace lf
