// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/resolve.h"

#include <algorithm>
#include <vector>

#include "composite/rows.h"
#include "render/sum_planes.h"

namespace lf {
namespace {

constexpr float kOneLevel = 1 << kSumFractionBits;

template <typename T>
bool any_set(const T* values, int n) {
  T any = 0;
  for (int i = 0; i < n; i++) any |= values[i];
  return any != 0;
}

void hide(float* __restrict scale, const uint8_t* __restrict uncovered, int n) {
  for (int i = 0; i < n; i++) scale[i] = uncovered[i] ? 0.f : scale[i];
}

// BT.601, full range; chroma without the 128 offset.
struct YCbCr {
  float y, cb, cr;
};
YCbCr to_ycbcr(const Background& b) {
  return {0.299f * b.r + 0.587f * b.g + 0.114f * b.b, -0.168736f * b.r - 0.331264f * b.g + 0.5f * b.b,
          0.5f * b.r - 0.418688f * b.g - 0.081312f * b.b};
}

// Which rows need more than rounding.
class Weights {
 public:
  Weights(const ConstSumPlanes& sum, const uint8_t* uncovered)
      : sum_(sum), uncovered_(uncovered), width_(sum.rect.width()) {}

  const uint16_t* lost(int y) const { return sum_.lost ? sum_.lost + y * sum_.lost_stride : nullptr; }
  // The factors for the sums of row y, 0 where the background shows; false if the row is its sum as it is.
  bool scales(int y, float* scale) const {
    const uint8_t* uncovered = uncovered_ ? uncovered_ + static_cast<size_t>(y) * width_ : nullptr;
    const bool some_lost = lost(y) && any_set(lost(y), width_), some_hidden = uncovered && any_set(uncovered, width_);
    if (!some_lost && !some_hidden) return false;
    if (some_lost)
      make_scales(scale, lost(y), width_);
    else
      std::fill_n(scale, width_, 1 / kOneLevel);
    if (some_hidden) hide(scale, uncovered, width_);
    return true;
  }

 private:
  const ConstSumPlanes& sum_;
  const uint8_t* uncovered_;
  int width_;
};

void interleave(uint8_t* __restrict out, const RgbLayout& layout, const uint8_t* __restrict r,
                const uint8_t* __restrict g, const uint8_t* __restrict b, int n) {
  const int step = layout.pixel_stride, opaque = 6 - layout.r - layout.g - layout.b;
  for (int x = 0; x < n; x++) {
    out[step * x + layout.r] = r[x];
    out[step * x + layout.g] = g[x];
    out[step * x + layout.b] = b[x];
    if (step == 4) out[step * x + opaque] = 255;
  }
}

void resolve_rgb(const ConstSumPlanes& sum, const Weights& weights, const Background& background,
                 const RgbLayout& layout, uint8_t* plane, ptrdiff_t stride) {
  const int w = sum.rect.width();
  const float back[3] = {static_cast<float>(background.r), static_cast<float>(background.g),
                         static_cast<float>(background.b)};
  std::vector<float> scale(w);
  std::vector<uint8_t> rows(3 * static_cast<size_t>(w));
  uint8_t* const row[3] = {&rows[0], &rows[w], &rows[2 * static_cast<size_t>(w)]};
  for (int y = 0; y < sum.rect.height(); y++) {
    const int16_t* const in[3] = {sum.plane[0] + y * sum.stride[0], sum.plane[1] + y * sum.stride[1],
                                  sum.plane[2] + y * sum.stride[2]};
    uint8_t* const out = plane + y * stride;
    if (!weights.scales(y, scale.data())) {
      round_rgb_row(out, layout, in[0], in[1], in[2], w);
      continue;
    }
    for (int c = 0; c < 3; c++) scale_row(row[c], in[c], scale.data(), back[c], w);
    interleave(out, layout, row[0], row[1], row[2], w);
  }
}

void interleave(uint8_t* __restrict out, const uint8_t* __restrict cb, const uint8_t* __restrict cr, int n) {
  for (int x = 0; x < n; x++) {
    out[2 * x] = cb[x];
    out[2 * x + 1] = cr[x];
  }
}

void resolve_i420(const ConstSumPlanes& sum, const Weights& weights, const Background& background,
                  uint8_t* const plane[3], const ptrdiff_t stride[3]) {
  const int w = sum.rect.width(), h = sum.rect.height(), cw = chroma_size(w);
  const YCbCr back = to_ycbcr(background);
  std::vector<float> scale(w), share(cw), chroma_scale(cw);
  std::vector<int32_t> lost(cw), hidden(cw);  // sums over the pixels of a chroma sample
  const bool interleaved = chroma_step(plane) == 2;
  std::vector<uint8_t> rows_of_chroma(interleaved ? 2 * static_cast<size_t>(cw) : 0);
  for (int cy = 0; cy < chroma_size(h); cy++) {
    const int rows = std::min(2, h - 2 * cy);
    std::ranges::fill(lost, 0);
    std::ranges::fill(hidden, 0);
    bool plain = true;
    for (int y = 2 * cy; y < 2 * cy + rows; y++) {
      const int16_t* const in = sum.plane[0] + y * sum.stride[0];
      uint8_t* const out = plane[0] + y * stride[0];
      if (!weights.scales(y, scale.data())) {
        round_row(out, in, w);
        continue;
      }
      plain = false;
      scale_row(out, in, scale.data(), back.y, w);
      add_pairs(lost.data(), hidden.data(), weights.lost(y), scale.data(), w);
    }
    // Lost weight is the mean over the sample's pixels; the background takes the share of those that show it.
    if (!plain) {
      const int pairs = w / 2;
      const auto pixels = static_cast<float>(rows);
      make_chroma_scales(chroma_scale.data(), share.data(), lost.data(), hidden.data(), 2 * pixels, pairs);
      if (cw > pairs) make_chroma_scales(&chroma_scale[pairs], &share[pairs], &lost[pairs], &hidden[pairs], pixels, 1);
    }
    for (int c = 1; c < 3; c++) {
      const int16_t* const in = sum.plane[c] + cy * sum.stride[c];
      uint8_t* const out = interleaved ? &rows_of_chroma[c == 1 ? 0 : cw] : plane[c] + cy * stride[c];
      if (plain) {
        round_chroma_row(out, in, cw, 128);
        continue;
      }
      scale_chroma_row(out, in, chroma_scale.data(), share.data(), c == 1 ? back.cb : back.cr, cw);
    }
    if (interleaved) interleave(plane[1] + cy * stride[1], rows_of_chroma.data(), &rows_of_chroma[cw], cw);
  }
}

}  // namespace

void resolve(const ConstSumPlanes& sum, const uint8_t* uncovered, const Background& background, const RgbLayout& layout,
             uint8_t* const plane[3], const ptrdiff_t stride[3]) {
  const Weights weights(sum, uncovered);
  if (sum.family == PixelFamily::kRgb) resolve_rgb(sum, weights, background, layout, plane[0], stride[0]);
  if (sum.family == PixelFamily::kI420) resolve_i420(sum, weights, background, plane, stride);
}

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
