// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/trial_renderer.h"

#include <algorithm>
#include <memory>

#include "focus/trial_nodes.h"
#include "render/source_region.h"

namespace lf {
namespace {

// Full-range BT.601, in 8 bits of fraction.
inline int luma_of(int r, int g, int b) { return (77 * r + 150 * g + 29 * b + 128) >> 8; }

void read_luma(const ImageView& image, int y, int x0, int x1, uint8_t* out) {
  if (image.family == PixelFamily::kI420) {
    std::copy_n(image.plane[0] + y * image.stride[0] + x0, x1 - x0, out);
    return;
  }
  const RgbLayout& at = image.layout;
  const uint8_t* pixel = image.plane[0] + y * image.stride[0] + ptrdiff_t{x0} * at.pixel_stride;
  for (int x = x0; x < x1; x++, pixel += at.pixel_stride)
    *out++ = static_cast<uint8_t>(luma_of(pixel[at.r], pixel[at.g], pixel[at.b]));
}

}  // namespace

void box_luma(const ImageView& image, const Rect& rect, BoxedLuma& out) {
  const int width = rect.width(), height = rect.height();
  out.rect = rect;
  out.values.resize(static_cast<size_t>(width) * height);
  constexpr int kBefore = kTrialBox / 2 - 1;
  const int x0 = std::max(rect.x0 - kBefore, 0), x1 = std::min(rect.x1 + kTrialBox - kBefore - 1, image.width);
  std::vector<uint8_t> luma(static_cast<size_t>(width) + kTrialBox - 1);
  std::vector<std::vector<uint16_t>> rows(kTrialBox, std::vector<uint16_t>(width));  // sums along rows, round robin
  std::vector<int> row_of(kTrialBox, -1);
  const auto row_sums = [&](int y) -> const std::vector<uint16_t>& {
    std::vector<uint16_t>& row = rows[static_cast<size_t>(y) % kTrialBox];
    if (row_of[static_cast<size_t>(y) % kTrialBox] == y) return row;
    row_of[static_cast<size_t>(y) % kTrialBox] = y;
    uint8_t* const first = luma.data() + (x0 - (rect.x0 - kBefore));
    read_luma(image, y, x0, x1, first);
    std::fill(luma.data(), first, *first);
    std::fill(first + (x1 - x0), luma.data() + luma.size(), first[x1 - x0 - 1]);
    for (int x = 0; x < width; x++)
      row[x] = static_cast<uint16_t>(luma[x] + luma[x + 1] + luma[x + 2] + luma[x + 3]);
    return row;
  };
  static_assert(kTrialBox == 4);
  for (int y = 0; y < height; y++) {
    const auto row = [&](int k) {
      return row_sums(std::clamp(rect.y0 + y - kBefore + k, 0, image.height - 1)).data();
    };
    const uint16_t *a = row(0), *b = row(1), *c = row(2), *d = row(3);
    uint8_t* to = out.values.data() + static_cast<size_t>(y) * width;
    for (int x = 0; x < width; x++) to[x] = static_cast<uint8_t>((a[x] + b[x] + c[x] + d[x] + 8) >> 4);
  }
}

namespace {

// Bilinear, in 8 bits of fraction. (x, y) relative to the first value.
inline int sample(const BoxedLuma& luma, float x, float y) {
  const int width = luma.rect.width(), height = luma.rect.height();
  const int fixed_x = static_cast<int>(std::clamp(x, 0.f, static_cast<float>(width - 1)) * 256);
  const int fixed_y = static_cast<int>(std::clamp(y, 0.f, static_cast<float>(height - 1)) * 256);
  const int x0 = fixed_x >> 8, y0 = fixed_y >> 8, ax = fixed_x & 255, ay = fixed_y & 255;
  const int right = x0 + 1 < width ? 1 : 0;
  const uint8_t* const top = luma.values.data() + static_cast<size_t>(y0) * width + x0;
  const uint8_t* const bottom = top + (y0 + 1 < height ? width : 0);
  const int upper = top[0] * (256 - ax) + top[right] * ax, lower = bottom[0] * (256 - ax) + bottom[right] * ax;
  return (upper * (256 - ay) + lower * ay + (1 << 15)) >> 16;
}

inline void add_saturated(uint16_t& sum, float value) {
  sum = static_cast<uint16_t>(std::min(sum + static_cast<int>(value + 0.5f), 65535));
}

inline void add_luma(Moments& sums, size_t node, float weight, int luma) {
  const auto value = static_cast<float>(luma);
  add_saturated(sums.weight[node], weight * Moments::kWeightOne);
  add_saturated(sums.luma[node], weight * value * Moments::kLumaOne);
  add_saturated(sums.square[node], weight * value * value);
}

// A camera and its luma.
struct Sampled {
  Sampled(const RenderJob& job, const Source& source) : where(job, source.camera, *source.rig_camera) {
    if (where.rect.empty()) return;
    box_luma(source.image, needed_pixels(job.plan(), source.camera, *source.rig_camera), luma);
    left = static_cast<float>(luma.rect.x0) + 0.5f;
    top = static_cast<float>(luma.rect.y0) + 0.5f;
  }
  // 0..255, at a position in the image.
  int at(float x, float y) const { return sample(luma, x - left, y - top); }
  TrialCamera where;
  BoxedLuma luma;
  float left = 0, top = 0;
};

}  // namespace

void add_moments(const RenderJob& job, std::span<const Source> sources, std::span<const std::vector<uint8_t>> trials,
                 std::span<Moments> sums, const ParallelFor& parallel) {
  const ViewPlan& plan = job.plan();
  const FocalMap& map = *plan.view().focus.map;
  job.owners();  // made once, not by whichever thread comes first
  std::vector<const Source*> seeing;
  for (const Source& source : sources) {
    if (source.image.family == PixelFamily::kNone || plan.camera_rect(source.camera).empty()) continue;
    plain::check_image(*source.rig_camera, source.image);
    seeing.push_back(&source);
  }
  std::vector<std::unique_ptr<Sampled>> cameras(seeing.size());
  parallel(seeing.size(), [&](size_t i) { cameras[i] = std::make_unique<Sampled>(job, *seeing[i]); });
  constexpr int kRows = 8;  // of a task
  parallel(static_cast<size_t>((map.rows + kRows - 1) / kRows), [&](size_t band) {
    const int first = static_cast<int>(band) * kRows, last = std::min(first + kRows, map.rows);
    for (const std::unique_ptr<Sampled>& camera : cameras)
      for_trial_nodes(job, camera->where, trials, first, last,
                      [&](size_t t, size_t node, float weight, float x, float y) {
                        add_luma(sums[t], node, weight, camera->at(x, y));
                      });
  });
}

}  // namespace lf
