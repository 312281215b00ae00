// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <cmath>
#include <vector>

#include "render/camera_weights.h"
#include "render/fetched_images.h"
#include "render/gl/sum_drawer.h"
#include "render/gl/sum_shader.h"
#include "render/ownership.h"
#include "render/sampler.h"

namespace lf::gl {
namespace {

uint16_t bits(double levels) {
  return static_cast<uint16_t>(static_cast<int16_t>(std::lrint(levels * (1 << kSumFractionBits))));
}

// A slot's part of a pixel.
struct Part {
  const simd::Slot* slot;
  float weight;
  bool seen;
  Vec2 position;  // if it is seen
};

// Parts of the pixel: at most three where the mesh blends.
class Parts {
 public:
  Parts(const simd::SumTask& task, int x, int y) {
    int32_t owner = OwnerMap::kNone;
    for (const OwnerRun& run : task.runs->row(y, x, x + 1)) owner = run.face;
    if (owner == OwnerMap::kNone) return;
    const ViewPlan& plan = *task.plan;
    if (const BlendGrid* const grid = plan.blend()) {
      for (const simd::Slot& slot : task.slots)
        if (const int weight = is_in(slot.rect, x, y) ? grid->weight(slot.camera, x, y) : 0)
          add(plan, slot, static_cast<float>(weight) / BlendGrid::kOne, x, y);
      return;
    }
    const FacePlan& face = plan.faces()[static_cast<size_t>(owner)];
    const Vec2 ray = plan.rays().at(x, y);
    const FaceWeights weights = face_weights(face, ray);
    for (int k = 0; k < 3; k++) {
      if (face.camera[k] == MeshFace::kNone || weights.w[k] == 0) continue;
      const int32_t slot = task.slot_of_camera[face.camera[k]];
      if (slot >= 0) add(plan, task.slots[static_cast<size_t>(slot)], weights.w[k], x, y);
    }
  }
  auto begin() const { return parts_.begin(); }
  auto end() const { return parts_.end(); }

 private:
  static bool is_in(const Rect& rect, int x, int y) {
    return x >= rect.x0 && x < rect.x1 && y >= rect.y0 && y < rect.y1;
  }
  void add(const ViewPlan& plan, const simd::Slot& slot, float weight, int x, int y) {
    Part& part = parts_.emplace_back(Part{&slot, weight, false, {}});
    part.seen = slot.image.family != PixelFamily::kNone &&
                slot.projection->project(plan.rays().at(x, y), plan.inverse_at(x, y), part.position);
  }

  static std::vector<Part>& emptied() {
    thread_local std::vector<Part> parts;
    parts.clear();
    return parts;
  }
  std::vector<Part>& parts_ = emptied();  // of the thread: one pixel's at a time
};

void mend_pixel(const simd::SumTask& task, FetchedImages& images, int x, int y, uint16_t* out, uint16_t& out_lost) {
  double sum[3] = {}, lost = 0;
  const bool rgb = task.family == PixelFamily::kRgb;
  for (const Part& part : Parts(task, x, y)) {
    if (!part.seen || images.of(*part.slot).family == PixelFamily::kNone) {
      lost += part.weight;
      continue;
    }
    const ImageView& image = images.of(*part.slot);
    const plain::Sampler at(part.position, image.width, image.height);
    const int offset[3] = {rgb ? image.layout.r : 0, image.layout.g, image.layout.b};
    for (int c = 0; c < (rgb ? 3 : 1); c++)
      sum[c] +=
          part.weight * at.sample(image.plane[0] + offset[c], image.stride[0], rgb ? image.layout.pixel_stride : 1);
  }
  for (int c = 0; c < (rgb ? 3 : 1); c++) *out++ = bits(sum[c]);
  out_lost = static_cast<uint16_t>(std::lrint(lost * kLostOne));
}

// (x, y): the first of four pixels of `rect`.
void mend_chroma(const simd::SumTask& task, FetchedImages& images, const Rect& rect, int x, int y, uint16_t* out) {
  struct Share {
    const simd::Slot* slot;
    double weight;
    Vec2 position;  // of one pixel that is seen
  };
  std::vector<Share> shares;
  int pixels = 0;
  for (int j = y; j < std::min(y + 2, rect.y1); j++)
    for (int i = x; i < std::min(x + 2, rect.x1); i++) {
      pixels++;
      for (const Part& part : Parts(task, i, j)) {
        if (!part.seen) continue;
        auto share = std::ranges::find(shares, part.slot, &Share::slot);
        if (share == shares.end()) share = shares.insert(share, {part.slot, 0, {}});
        share->weight += part.weight;
        share->position = part.position;
      }
    }
  double sum[2] = {};
  const ViewPlan& plan = *task.plan;
  for (const Share& share : shares) {
    const ImageView& image = images.of(*share.slot);
    if (image.family == PixelFamily::kNone) continue;
    Vec2 position;
    if (!share.slot->projection->project_beyond(plan.rays().at_centre_of_four(x, y), plan.inverse_at(x + 0.5, y + 0.5),
                                                position))
      position = share.position;
    const plain::Sampler at((position - 0.5) / 2.0, chroma_size(image.width), chroma_size(image.height));
    for (int c = 0; c < 2; c++)
      sum[c] += share.weight / pixels * (at.sample(image.plane[1 + c], image.stride[1 + c], 1) - 128);
  }
  for (int c = 0; c < 2; c++) out[c] = bits(sum[c]);
}

}  // namespace

// Whether any of them is that; without a branch for each.
static bool has(const uint16_t* values, int count, int step, uint16_t value) {
  unsigned any = 0;
  for (int i = 0; i < count; i++) any |= values[i * step] == value;
  return any;
}

size_t open_samples(const DrawnSum& sum) {
  const Rect &rect = sum.rect, &part = sum.lost_rect;
  size_t open = 0;
  for (int y = part.y0; y < part.y1; y++) {
    const uint16_t* const lost = &sum.lost[static_cast<size_t>(y - part.y0) * sum.lost_pitch];
    open += static_cast<size_t>(std::count(lost, lost + part.width(), uint16_t{kDoubt}));
    if (sum.family != PixelFamily::kI420 || y % 2) continue;
    const size_t row = static_cast<size_t>(y - rect.y0) / 2 * chroma_size(rect.width());
    const uint16_t* const chroma = &sum.chroma[2 * (row + (part.x0 - rect.x0) / 2)];
    for (int i = 0; i < chroma_size(part.width()); i++) open += 4 * (chroma[2 * i] == kChromaDoubt);
  }
  return open;
}

size_t mend(const simd::SumTask& task, std::span<const Source> sources, DrawnSum& sum) {
  FetchedImages images(task, sources);
  const Rect &rect = sum.rect, &part = sum.lost_rect;
  const int values = sum.family == PixelFamily::kRgb ? 4 : 1;
  size_t mended = 0;
  for (int y = part.y0; y < part.y1; y++) {
    uint16_t* lost = &sum.lost[static_cast<size_t>(y - part.y0) * sum.lost_pitch];
    if (!has(lost, part.width(), 1, kDoubt)) continue;
    for (int x = part.x0; x < part.x1; x++, lost++) {
      if (*lost != kDoubt) continue;
      const size_t pixel = static_cast<size_t>(y - rect.y0) * sum.pitch + (x - rect.x0);
      mend_pixel(task, images, x, y, &sum.pixels[pixel * values], *lost);
      mended++;
    }
  }
  if (sum.family != PixelFamily::kI420) return mended;
  for (int y = part.y0; y < part.y1; y += 2) {
    const size_t row = static_cast<size_t>(y - rect.y0) / 2 * chroma_size(rect.width());
    uint16_t* chroma = &sum.chroma[2 * (row + (part.x0 - rect.x0) / 2)];
    if (!has(chroma, chroma_size(part.width()), 2, kChromaDoubt)) continue;
    for (int x = part.x0; x < part.x1; x += 2, chroma += 2) {
      if (chroma[0] != kChromaDoubt) continue;
      mend_chroma(task, images, rect, x, y, chroma);
      mended++;
    }
  }
  return mended;
}

bool DrawnSum::copy_rows(int y0, int y1, const SumPlanes& out) const {
  // What is not in the sum's rectangle has nothing in it.
  const bool rgb = family == PixelFamily::kRgb;
  const Rect part = intersect(rect, {out.rect.x0, y0, out.rect.x1, y1});
  bool any_lost = false;
  for (int y = y0; y < y1; y++) {
    const bool any = !part.empty() && y >= part.y0 && y < part.y1;
    const auto row_of = [&](auto* plane, ptrdiff_t stride) {
      auto* row = plane + (y - out.rect.y0) * stride;
      if (!any || part.width() < out.rect.width()) std::fill_n(row, out.rect.width(), 0);
      return row - out.rect.x0;
    };
    const size_t first = static_cast<size_t>(y - rect.y0) * pitch + (part.x0 - rect.x0);
    for (int c = 0; c < (rgb ? 3 : 1); c++) {
      int16_t* __restrict const to = row_of(out.plane[c], out.stride[c]) + part.x0;
      if (!any) continue;
      const uint16_t* const from = &pixels[rgb ? 4 * first + c : first];
      const int step = rgb ? 4 : 1;
      if (rgb)
        for (int i = 0; i < part.width(); i++) to[i] = static_cast<int16_t>(from[i * step]);
      else
        std::copy_n(from, part.width(), reinterpret_cast<uint16_t*>(to));
    }
    const Rect with_loss = intersect(lost_rect, {out.rect.x0, y, out.rect.x1, y + 1});
    if (out.lost) std::fill_n(out.lost + (y - out.rect.y0) * out.lost_stride, out.rect.width(), uint16_t{0});
    if (with_loss.empty()) continue;
    const uint16_t* from = &lost[static_cast<size_t>(y - lost_rect.y0) * lost_pitch + (with_loss.x0 - lost_rect.x0)];
    any_lost = any_lost || std::any_of(from, from + with_loss.width(), [](uint16_t v) { return v != 0; });
    if (out.lost)
      std::copy_n(from, with_loss.width(),
                  out.lost + (y - out.rect.y0) * out.lost_stride + (with_loss.x0 - out.rect.x0));
  }
  if (rgb) return any_lost;
  for (int y = y0; y < y1; y += 2) {
    int16_t* to[2];
    for (int c = 0; c < 2; c++) {
      to[c] = out.plane[1 + c] + (y - out.rect.y0) / 2 * out.stride[1 + c];
      if (part.width() < out.rect.width() || y < part.y0 || y >= part.y1)
        std::fill_n(to[c], chroma_size(out.rect.width()), int16_t{0});
      to[c] += (part.x0 - out.rect.x0) / 2;
    }
    if (part.empty() || y < part.y0 || y >= part.y1) continue;
    const size_t row = static_cast<size_t>(y - rect.y0) / 2 * chroma_size(rect.width());
    const uint16_t* from = &chroma[2 * (row + (part.x0 - rect.x0) / 2)];
    int16_t* __restrict const cb = to[0], * __restrict const cr = to[1];
    for (int i = 0; i < chroma_size(part.width()); i++) {
      cb[i] = static_cast<int16_t>(from[2 * i]);
      cr[i] = static_cast<int16_t>(from[2 * i + 1]);
    }
  }
  return any_lost;
}

}  // namespace lf::gl
