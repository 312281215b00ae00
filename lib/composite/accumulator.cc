// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/accumulator.h"

#include <algorithm>

#include "base/error.h"

namespace lf {
namespace {

// One more fragment can be added to a sum held to these without leaving its type, so one min (and max) makes adding
// safe against any input. They lie beyond what 127 whole fragments reach.
constexpr int16_t kSumRoom = INT16_MAX - 255, kChromaRoom = INT16_MAX - 127;
constexpr uint16_t kLostRoom = UINT16_MAX - 255;

// With less valid weight than this (255 = 1) a pixel shows the background.
constexpr int kLeastWeight = 3;

// The loops over a row are free of branches and of aliasing, so that the compiler makes vector code of them.

void add_row(int16_t* __restrict sum, const uint8_t* __restrict in, int n) {
  for (int i = 0; i < n; i++) sum[i] = static_cast<int16_t>(std::min(sum[i], kSumRoom) + in[i]);
}

void add_chroma_row(int16_t* __restrict sum, const int8_t* __restrict in, int n) {
  for (int i = 0; i < n; i++) {
    const int16_t room = std::clamp<int16_t>(sum[i], -kChromaRoom, kChromaRoom);
    sum[i] = static_cast<int16_t>(room + in[i]);
  }
}

void add_lost_row(uint16_t* __restrict lost, const uint8_t* __restrict in, int n) {
  for (int i = 0; i < n; i++) lost[i] = static_cast<uint16_t>(std::min(lost[i], kLostRoom) + in[i]);
}

void saturate_row(uint8_t* __restrict out, const int16_t* __restrict sum, int n) {
  for (int i = 0; i < n; i++) out[i] = static_cast<uint8_t>(std::clamp<int16_t>(sum[i], 0, 255));
}

void saturate_chroma_row(uint8_t* __restrict out, const int16_t* __restrict sum, int n, int16_t offset) {
  for (int i = 0; i < n; i++) out[i] = static_cast<uint8_t>(std::clamp<int16_t>(sum[i], -128, 127) + offset);
}

void saturate_lost_row(uint8_t* __restrict out, const uint16_t* __restrict lost, int n) {
  for (int i = 0; i < n; i++) out[i] = static_cast<uint8_t>(std::min<uint16_t>(lost[i], 255));
}

template <typename T>
bool any_set(const T* values, int n) {
  T any = 0;
  for (int i = 0; i < n; i++) any |= values[i];
  return any != 0;
}

// To the nearest of 0..255, halves up. `v` is a sum, scaled: exact in float wherever the result is not clamped, up to
// the rounding of the scale itself (2^-23 of the value).
uint8_t to_byte(float v) { return static_cast<uint8_t>(std::clamp(v + 0.5f, 0.f, 255.f)); }

// What a pixel of the row becomes is sum * scale, or the background where scale is 0.
void make_scales(float* __restrict scale, const uint16_t* __restrict lost, const uint8_t* __restrict uncovered, int n) {
  for (int i = 0; i < n; i++) {
    const int left = 255 - std::min<int>(lost[i], 255);
    const bool hidden = left < kLeastWeight || (uncovered && uncovered[i]);
    scale[i] = hidden ? 0.f : 255.f / static_cast<float>(std::max(left, 1));
  }
}

// BT.601, full range; chroma without the 128 offset.
struct YCbCr {
  float y, cb, cr;
};
YCbCr to_ycbcr(const Background& b) {
  return {0.299f * b.r + 0.587f * b.g + 0.114f * b.b, -0.168736f * b.r - 0.331264f * b.g + 0.5f * b.b,
          0.5f * b.r - 0.418688f * b.g - 0.081312f * b.b};
}

bool inside(const Rect& rect, int width, int height) {
  return !rect.empty() && rect.x0 >= 0 && rect.y0 >= 0 && rect.x1 <= width && rect.y1 <= height;
}

}  // namespace

void Accumulator::reset(PixelFamily family, int width, int height) {
  family_ = family;
  width_ = width;
  height_ = height;
  touched_ = {};
  any_lost_ = false;
  sum_.assign(packed_size(family, width, height), 0);
  lost_.assign(static_cast<size_t>(width) * height, 0);
  uncovered_.clear();
}

bool Accumulator::add(const Fragment& fragment) {
  const Rect& rect = fragment.rect;
  if (family_ == PixelFamily::kNone || fragment.family != family_ || !inside(rect, width_, height_)) return false;
  if (family_ == PixelFamily::kI420 && (rect.x0 % 2 != 0 || rect.y0 % 2 != 0)) return false;
  const int w = rect.width(), h = rect.height();
  const size_t area = static_cast<size_t>(w) * h;
  if (fragment.pixels.size() != packed_size(family_, w, h)) return false;
  if (!fragment.lost.empty() && fragment.lost.size() != area) return false;

  const auto at = [&](int x, int y) { return static_cast<size_t>(y) * width_ + x; };
  const uint8_t* in = fragment.pixels.data();
  if (family_ == PixelFamily::kRgb) {
    for (int y = 0; y < h; y++, in += static_cast<size_t>(w) * 3)
      add_row(&sum_[at(rect.x0, rect.y0 + y) * 3], in, w * 3);
  } else {
    for (int y = 0; y < h; y++, in += w) add_row(&sum_[at(rect.x0, rect.y0 + y)], in, w);
    const int chroma_width = chroma_size(width_), cw = chroma_size(w), ch = chroma_size(h);
    const size_t luma = at(0, height_), chroma = static_cast<size_t>(chroma_width) * chroma_size(height_);
    for (int plane = 0; plane < 2; plane++)
      for (int y = 0; y < ch; y++, in += cw)
        add_chroma_row(&sum_[luma + plane * chroma + static_cast<size_t>(rect.y0 / 2 + y) * chroma_width + rect.x0 / 2],
                       reinterpret_cast<const int8_t*>(in), cw);
  }
  if (!fragment.lost.empty()) {
    any_lost_ = true;
    for (int y = 0; y < h; y++)
      add_lost_row(&lost_[at(rect.x0, rect.y0 + y)], &fragment.lost[static_cast<size_t>(y) * w], w);
  }
  touched_ = unite(touched_, rect);
  return true;
}

bool Accumulator::add_lost_hat(const Rect& rect, const std::vector<float>& hat) {
  if (family_ == PixelFamily::kNone || !inside(rect, width_, height_)) return false;
  const int w = rect.width(), h = rect.height();
  if (hat.size() != static_cast<size_t>(w) * h) return false;
  std::vector<uint8_t> row(w);
  for (int y = 0; y < h; y++) {
    const float* in = &hat[static_cast<size_t>(y) * w];
    // The comparison comes first so that a NaN is nothing.
    for (int x = 0; x < w; x++) row[x] = to_byte(in[x] > 0 ? std::min(in[x], 1.f) * 255 : 0.f);
    add_lost_row(&lost_[static_cast<size_t>(rect.y0 + y) * width_ + rect.x0], row.data(), w);
  }
  any_lost_ = true;
  touched_ = unite(touched_, rect);
  return true;
}

void Accumulator::set_uncovered(const OwnerMap& whole_view) {
  if (whole_view.region() != Rect{0, 0, width_, height_})
    throw Error("the owner map of uncovered pixels does not span the picture");
  uncovered_.resize(static_cast<size_t>(width_) * height_);
  for (int y = 0; y < height_; y++) {
    const int32_t* owner = whole_view.row(0, y);
    uint8_t* out = &uncovered_[static_cast<size_t>(y) * width_];
    for (int x = 0; x < width_; x++) out[x] = owner[x] == OwnerMap::kNone;
  }
}

bool Accumulator::row_scales(int y, float* scale) const {
  const size_t row = static_cast<size_t>(y) * width_;
  const uint8_t* uncovered = uncovered_.empty() ? nullptr : &uncovered_[row];
  if (!(any_lost_ && any_set(&lost_[row], width_)) && !(uncovered && any_set(uncovered, width_))) return false;
  make_scales(scale, &lost_[row], uncovered, width_);
  return true;
}

void Accumulator::resolve_rgb(const Background& background, const RgbLayout& layout, uint8_t* plane,
                              ptrdiff_t stride) const {
  const int w = width_;
  const bool direct = layout == RgbLayout{};
  const int padding = layout.pixel_stride == 4 ? 6 - layout.r - layout.g - layout.b : -1;
  std::vector<float> scale(w);
  std::vector<uint8_t> packed(direct ? 0 : static_cast<size_t>(w) * 3);
  for (int y = 0; y < height_; y++) {
    const int16_t* sum = &sum_[static_cast<size_t>(y) * w * 3];
    uint8_t* const out = plane + y * stride;
    uint8_t* const rgb = direct ? out : packed.data();
    if (row_scales(y, scale.data())) {
      for (int x = 0; x < w; x++, sum += 3) {
        const float s = scale[x];
        rgb[3 * x + 0] = s == 0 ? background.r : to_byte(sum[0] * s);
        rgb[3 * x + 1] = s == 0 ? background.g : to_byte(sum[1] * s);
        rgb[3 * x + 2] = s == 0 ? background.b : to_byte(sum[2] * s);
      }
    } else {
      saturate_row(rgb, sum, w * 3);
    }
    if (direct) continue;
    for (int x = 0; x < w; x++) {
      uint8_t* const pixel = out + static_cast<ptrdiff_t>(x) * layout.pixel_stride;
      pixel[layout.r] = rgb[3 * x];
      pixel[layout.g] = rgb[3 * x + 1];
      pixel[layout.b] = rgb[3 * x + 2];
      if (padding >= 0) pixel[padding] = 255;
    }
  }
}

void Accumulator::resolve_i420(const Background& background, uint8_t* const plane[3], const ptrdiff_t stride[3]) const {
  const YCbCr back = to_ycbcr(background);
  const uint8_t back_y = to_byte(back.y);
  const int w = width_, cw = chroma_size(w), ch = chroma_size(height_);
  const size_t luma = static_cast<size_t>(w) * height_;
  std::vector<float> scale(w);
  std::vector<int> lost(cw), hidden(cw);  // over the pixels of a chroma sample
  std::vector<float> chroma_scale(cw), share(cw);
  for (int cy = 0; cy < ch; cy++) {
    const int rows = std::min(2, height_ - 2 * cy);
    bool plain = true;
    std::fill(lost.begin(), lost.end(), 0);
    std::fill(hidden.begin(), hidden.end(), 0);
    for (int y = 2 * cy; y < 2 * cy + rows; y++) {
      const int16_t* sum = &sum_[static_cast<size_t>(y) * w];
      uint8_t* const out = plane[0] + y * stride[0];
      if (!row_scales(y, scale.data())) {
        saturate_row(out, sum, w);
        continue;
      }
      plain = false;
      for (int x = 0; x < w; x++) out[x] = scale[x] == 0 ? back_y : to_byte(sum[x] * scale[x]);
      const uint16_t* row_lost = &lost_[static_cast<size_t>(y) * w];
      for (int x = 0; x < w; x++) {
        lost[x / 2] += std::min<int>(row_lost[x], 255);
        hidden[x / 2] += scale[x] == 0;
      }
    }
    // Lost weight is the mean over the sample's pixels; the background takes the share of those that show it.
    if (!plain)
      for (int cx = 0; cx < cw; cx++) {
        const float n = static_cast<float>(rows * std::min(2, w - 2 * cx));
        const float left = 255 - static_cast<float>(lost[cx]) / n;
        share[cx] = left < kLeastWeight ? 1.f : static_cast<float>(hidden[cx]) / n;
        chroma_scale[cx] = left < kLeastWeight ? 0.f : 255 / left;
      }
    for (int c = 0; c < 2; c++) {
      const int16_t* sum = &sum_[luma + (static_cast<size_t>(c) * ch + cy) * cw];
      uint8_t* const out = plane[1 + c] + cy * stride[1 + c];
      if (plain) {
        saturate_chroma_row(out, sum, cw, 128);
        continue;
      }
      const float back_c = c == 0 ? back.cb : back.cr;
      for (int cx = 0; cx < cw; cx++) {
        const float colour = std::clamp(sum[cx] * chroma_scale[cx], -128.f, 127.f);
        out[cx] = to_byte(128 + colour * (1 - share[cx]) + back_c * share[cx]);
      }
    }
  }
}

void Accumulator::resolve(const Background& background, const RgbLayout& layout, uint8_t* const plane[3],
                          const ptrdiff_t stride[3]) const {
  if (family_ == PixelFamily::kRgb) resolve_rgb(background, layout, plane[0], stride[0]);
  if (family_ == PixelFamily::kI420) resolve_i420(background, plane, stride);
}

Image Accumulator::resolve(const Background& background) const {
  Image image(family_, width_, height_);
  if (family_ == PixelFamily::kNone) return image;
  const int count = family_ == PixelFamily::kRgb ? 1 : 3;
  uint8_t* plane[3] = {};
  ptrdiff_t stride[3] = {};
  for (int i = 0; i < count; i++) {
    plane[i] = image.plane(i);
    stride[i] = image.view().stride[i];
  }
  resolve(background, RgbLayout{}, plane, stride);
  return image;
}

std::optional<Fragment> Accumulator::partial_sum() const {
  if (touched_.empty()) return std::nullopt;
  Fragment out;
  out.family = family_;
  out.rect = touched_;
  if (family_ == PixelFamily::kI420) {  // a lost hat may begin at an odd pixel
    out.rect.x0 &= ~1;
    out.rect.y0 &= ~1;
  }
  const Rect& rect = out.rect;
  const int w = rect.width(), h = rect.height();
  const auto at = [&](int x, int y) { return static_cast<size_t>(y) * width_ + x; };
  out.pixels.resize(packed_size(family_, w, h));
  uint8_t* to = out.pixels.data();
  if (family_ == PixelFamily::kRgb) {
    for (int y = rect.y0; y < rect.y1; y++, to += static_cast<size_t>(w) * 3)
      saturate_row(to, &sum_[at(rect.x0, y) * 3], w * 3);
  } else {
    for (int y = rect.y0; y < rect.y1; y++, to += w) saturate_row(to, &sum_[at(rect.x0, y)], w);
    const int chroma_width = chroma_size(width_), cw = chroma_size(w), ch = chroma_size(h);
    const size_t luma = at(0, height_), chroma = static_cast<size_t>(chroma_width) * chroma_size(height_);
    for (int plane = 0; plane < 2; plane++)
      for (int y = 0; y < ch; y++, to += cw)
        saturate_chroma_row(
            to, &sum_[luma + plane * chroma + static_cast<size_t>(rect.y0 / 2 + y) * chroma_width + rect.x0 / 2], cw,
            0);
  }
  if (any_lost_) {
    out.lost.resize(static_cast<size_t>(w) * h);
    for (int y = 0; y < h; y++)
      saturate_lost_row(&out.lost[static_cast<size_t>(y) * w], &lost_[at(rect.x0, rect.y0 + y)], w);
    if (std::all_of(out.lost.begin(), out.lost.end(), [](uint8_t v) { return v == 0; })) out.lost.clear();
  }
  return out;
}

}  // namespace lf
