// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/trial_renderer.h"

#include <algorithm>
#include <cmath>

#include "render/contribution.h"
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

// A source with what is needed of it for every row.
struct TrialCamera {
  TrialCamera(const RenderJob& job, const Source& source)
      : corners(job.plan(), source.camera),
        rect(corners.owned(job.runs(), job.plan().camera_rect(source.camera))),
        projection(job.plan(), source.camera, *source.rig_camera),
        width(static_cast<float>(source.rig_camera->width)),
        height(static_cast<float>(source.rig_camera->height)) {}
  CameraCorners corners;
  Rect rect;  // of nodes that it has a weight in
  CameraProjection projection;
  float width, height;
  BoxedLuma luma;
};

// The nodes of a row in which a camera has a weight. Camera coordinates are base + inverse distance x slope, up to a
// positive factor.
struct RowNodes {
  std::vector<int> column;
  std::vector<float> weight, base[3], slope[3], x, y;
  std::vector<uint8_t> seen;
  size_t count = 0;

  void find(const RenderJob& job, const TrialCamera& camera, int row) {
    const ViewPlan& plan = job.plan();
    const auto room = static_cast<size_t>(camera.rect.width());
    for (auto* v : {&weight, &base[0], &base[1], &base[2], &slope[0], &slope[1], &slope[2], &x, &y}) v->resize(room);
    column.resize(room);
    seen.resize(room);
    count = 0;
    for (int c = camera.rect.x0; c < camera.rect.x1; c++) {
      const Vec2 ray = plan.rays().at(c, row);
      const float w = camera.corners.weight(plan, job.owners().at(c, row), ray);
      if (w == 0) continue;
      const Vec3 d(ray, 1), b = camera.projection.camera_from_ray() * d, s = camera.projection.per_inverse() * d;
      column[count] = c;
      weight[count] = w;
      for (int k = 0; k < 3; k++) {
        base[k][count] = static_cast<float>(b[k]);
        slope[k][count] = static_cast<float>(s[k]);
      }
      count++;
    }
  }

  // CameraProjection::project() in float: positions in the image, and which are seen there.
  void project(const FocalMap& map, const uint8_t* levels, const TrialCamera& camera, double eye_distance) {
    const Lens& lens = camera.projection.lens();
    const auto fx = static_cast<float>(lens.fx()), fy = static_cast<float>(lens.fy());
    const auto cx = static_cast<float>(lens.cx()), cy = static_cast<float>(lens.cy());
    const auto k1 = static_cast<float>(lens.k1()), k2 = static_cast<float>(lens.k2());
    const auto p1 = static_cast<float>(lens.p1()), p2 = static_cast<float>(lens.p2());
    const auto max_r2 = static_cast<float>(std::min(lens.max_radius() * lens.max_radius(), 1e30));
    const auto far_end = static_cast<float>(map.farthest);
    const auto scale = static_cast<float>((map.nearest - map.farthest) / FocalMap::kLevels);
    const auto eye = static_cast<float>(eye_distance);
    for (size_t i = 0; i < count; i++) {
      const float s = far_end + scale * static_cast<float>(levels[column[i]]);
      const float z = base[2][i] + s * slope[2][i], inverse = 1 / z;
      const float u = (base[0][i] + s * slope[0][i]) * inverse, v = (base[1][i] + s * slope[1][i]) * inverse;
      const float r2 = u * u + v * v, stretch = 1 + r2 * (k1 + r2 * k2);
      const float px = fx * (u * stretch + 2 * p1 * u * v + p2 * (r2 + 2 * u * u)) + cx;
      const float py = fy * (v * stretch + p1 * (r2 + 2 * v * v) + 2 * p2 * u * v) + cy;
      seen[i] = (z > 0) & (1 - s * eye > 0) & (r2 <= max_r2) & (px >= -0.5f) & (px <= camera.width - 0.5f) &
                (py >= -0.5f) & (py <= camera.height - 0.5f);
      x[i] = px;
      y[i] = py;
    }
  }
};

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
  std::vector<std::unique_ptr<TrialCamera>> cameras(seeing.size());
  parallel(seeing.size(), [&](size_t i) {
    cameras[i] = std::make_unique<TrialCamera>(job, *seeing[i]);
    if (cameras[i]->rect.empty()) return;
    box_luma(seeing[i]->image, needed_pixels(plan, seeing[i]->camera, *seeing[i]->rig_camera), cameras[i]->luma);
  });
  constexpr int kRows = 8;  // of a task
  parallel(static_cast<size_t>((map.rows + kRows - 1) / kRows), [&](size_t band) {
    thread_local RowNodes nodes;
    const int first = static_cast<int>(band) * kRows, last = std::min(first + kRows, map.rows);
    for (const std::unique_ptr<TrialCamera>& camera : cameras)
      for (int row = std::max(first, camera->rect.y0); row < std::min(last, camera->rect.y1); row++) {
        nodes.find(job, *camera, row);
        const size_t row_offset = static_cast<size_t>(row) * map.columns;
        const float left = static_cast<float>(camera->luma.rect.x0) + 0.5f;
        const float top = static_cast<float>(camera->luma.rect.y0) + 0.5f;
        for (size_t t = 0; t < trials.size(); t++) {
          nodes.project(map, trials[t].data() + row_offset, *camera, plan.eye_distance());
          for (size_t i = 0; i < nodes.count; i++) {
            if (!nodes.seen[i]) continue;
            const float weight = nodes.weight[i];
            const auto value = static_cast<float>(sample(camera->luma, nodes.x[i] - left, nodes.y[i] - top));
            const size_t node = row_offset + static_cast<size_t>(nodes.column[i]);
            add_saturated(sums[t].weight[node], weight * Moments::kWeightOne);
            add_saturated(sums[t].luma[node], weight * value * Moments::kLumaOne);
            add_saturated(sums[t].square[node], weight * value * value);
          }
        }
      }
  });
}

}  // namespace lf
