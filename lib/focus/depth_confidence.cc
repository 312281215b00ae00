// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/depth_confidence.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <utility>

#include "focus/depth_selection.h"

namespace lf {

void DepthConfidence::add(const Round& round) {
  constexpr float kMemory = 4;  // the mean covers about so many tested depths
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  if (round.costs.empty()) return;
  const size_t nodes = round.costs[0].size();
  if (others_.size() != nodes) others_.assign(nodes, 0);
  auto map = std::make_shared<FocalMap>();
  map->step = round.map.step;
  map->columns = round.map.columns;
  map->rows = round.map.rows;
  map->nearest = 1;
  map->levels.assign(nodes, 0);
  const int apart = std::max(1, static_cast<int>(std::ceil(round.levels_a_pixel)));
  for (size_t i = 0; i < nodes; i++) {
    float sum = 0, count = 0;
    for (size_t t = 1; t < round.costs.size(); t++) {
      const bool is_other = std::abs(round.levels[t][i] - round.levels[0][i]) >= apart;
      if (!is_other || !(round.costs[t][i] < kInfinity)) continue;
      sum += round.costs[t][i];
      count++;
    }
    if (count > 0) others_[i] += (sum / count - others_[i]) * (others_[i] > 0 ? count / (count + kMemory) : 1);
    const float deviation = round.costs[0][i];
    if (!(deviation < kInfinity) || !(others_[i] > 0)) continue;
    const float agreement = 1 - (deviation + kLumaNoise) / others_[i];
    map->levels[i] = static_cast<uint8_t>(std::lround(255 * std::clamp(round.evidence[i] * agreement, 0.f, 1.f)));
  }
  map_ = std::move(map);
}

}  // namespace lf
