// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/mean_luma.h"

#include <algorithm>
#include <cmath>

namespace lf {
namespace {

constexpr int kLeastWeight = Moments::kWeightOne / 6;
constexpr float kDarkest = 16, kBrightest = 240;             // luma
constexpr float kMostDeviation = 0.25f, kMostChange = 0.5f;  // of the mean

}  // namespace

void GainSum::add(float gain, float camera_weight) {
  weight += static_cast<uint32_t>(std::lround(camera_weight * kWeightOne));
  log2 += static_cast<int32_t>(std::lround(camera_weight * kWeightOne * std::log2(gain) * kOctave));
}

void GainSum::add(const GainSum& other) {
  weight += other.weight;
  log2 += other.log2;
}

float GainSum::mean() const {
  return weight == 0 ? 1 : std::exp2(static_cast<float>(log2) / static_cast<float>(weight) / kOctave);
}

std::vector<uint8_t> mean_luma(const Moments& moments, const GainSum& gains) {
  const int columns = moments.columns, rows = moments.rows;
  const float scale = gains.mean();
  std::vector<float> mean(moments.weight.size());
  for (size_t i = 0; i < mean.size(); i++) {
    if (moments.weight[i] < kLeastWeight) continue;
    const float weight = static_cast<float>(moments.weight[i]) / Moments::kWeightOne;
    const float value = static_cast<float>(moments.luma[i]) / Moments::kLumaOne / weight;
    const float variance = static_cast<float>(moments.square[i]) / weight - value * value;
    if (variance <= kMostDeviation * kMostDeviation * value * value) mean[i] = scale * value;
  }
  std::vector<uint8_t> levels(mean.size());
  for (int y = 1; y + 1 < rows; y++)
    for (int x = 1; x + 1 < columns; x++) {
      const size_t i = static_cast<size_t>(y) * columns + x;
      const auto around = {mean[i - 1], mean[i], mean[i + 1], mean[i - columns], mean[i + columns]};
      if (!(mean[i] >= kDarkest && mean[i] <= kBrightest)) continue;
      if (std::max(around) - std::min(around) > kMostChange * mean[i]) continue;
      levels[i] = static_cast<uint8_t>(std::lround(mean[i]));
    }
  return levels;
}

}  // namespace lf
