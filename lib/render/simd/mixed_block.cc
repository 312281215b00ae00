// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <cmath>

#include "render/sampler.h"
#include "render/simd/band_data.h"

namespace lf::simd {
namespace {

constexpr float kWeightOne = 32768, kLevel = 1 << 7;

int16_t to_sum(float levels) { return static_cast<int16_t>(std::lrintf(levels * kLevel)); }

void add(int16_t& sum, float levels) { sum = static_cast<int16_t>(sum + to_sum(levels)); }

}  // namespace

void add_mixed_block(const SumTask& task, const BlockWeights& weights, int pair, int x, int out, int y_end, int y,
                     Scratch& scratch) {
  const Slot& slot = task.slots[weights.slot];
  const ImageView& image = slot.image;
  const Rays& rays = task.plan->rays();
  const int x_end = std::min(x + kBlock, task.plan->view().width);
  struct Chroma {
    float weight = 0;
    Vec2 position;  // of one valid pixel
  } chroma[kChromaBlock];
  const int r_end = std::min(2 * pair + 2, y_end - y);
  for (int r = 2 * pair; r < r_end; r++)
    for (int i = 0; x + i < x_end; i++) {
      const int16_t w = weights.w[r][i];
      if (w == 0) continue;
      Vec2 position;
      if (!slot.projection->project(rays.at(x + i, y + r), task.plan->inverse_at(x + i, y + r), position)) {
        uint16_t& lost = scratch.lost[r][out * kBlock + i];
        lost = static_cast<uint16_t>(std::min(lost + w, 65535));
        scratch.any_lost = true;
        continue;
      }
      const float weight = static_cast<float>(w) / kWeightOne;
      const plain::Sampler at(position, image.width, image.height);
      if (image.family == PixelFamily::kI420) {
        add(scratch.sum[r][0][out * kBlock + i], weight * at.sample(image.plane[0], image.stride[0], 1));
        chroma[i / 2].weight += weight;
        chroma[i / 2].position = position;
      } else {
        const int offset[3] = {image.layout.r, image.layout.g, image.layout.b};
        for (int c = 0; c < 3; c++)
          add(scratch.sum[r][c][out * kBlock + i],
              weight * at.sample(image.plane[0] + offset[c], image.stride[0], image.layout.pixel_stride));
      }
    }
  if (image.family != PixelFamily::kI420) return;
  for (int k = 0; k < kChromaBlock && x + 2 * k < x_end; k++) {
    if (chroma[k].weight == 0) continue;
    const int pixels = (x + 2 * k + 1 < x_end ? 2 : 1) * (r_end - 2 * pair);
    const float weight = chroma[k].weight / static_cast<float>(pixels);
    Vec2 position;
    if (!slot.projection->project_beyond(rays.at_centre_of_four(x + 2 * k, y + 2 * pair),
                                         task.plan->inverse_at(x + 2 * k + 0.5, y + 2 * pair + 0.5), position))
      position = chroma[k].position;
    const plain::Sampler at((position - 0.5) / 2.0, chroma_size(image.width), chroma_size(image.height));
    for (int c = 1; c <= 2; c++)
      add(scratch.sum[pair][c][out * kChromaBlock + k], weight * (at.sample(image.plane[c], image.stride[c], 1) - 128));
  }
}

}  // namespace lf::simd
