// SPDX-License-Identifier: LGPL-2.1-or-later
#include "quality/wave_finder.h"

#include <algorithm>
#include <cmath>

namespace lf {
namespace {

constexpr double kForget = 12;      // seconds
constexpr double kLeast = 0.08;     // of the whole range: a hand covers most of the picture
constexpr double kStandsOut = 1.8;  // times the next one

}  // namespace

void WaveFinder::see(size_t camera, std::span<const float> parts, double time) {
  Camera& c = cameras_[camera];
  if (c.usual.size() != parts.size()) {
    c.usual.assign(parts.begin(), parts.end());
    c.time = time;
    c.change = 0;
    return;
  }
  const auto count = static_cast<double>(std::max<size_t>(parts.size(), 1));
  double whole = 0, change = 0;
  for (size_t i = 0; i < parts.size(); i++) whole += (parts[i] - c.usual[i]) / count;
  for (size_t i = 0; i < parts.size(); i++) change += std::abs(parts[i] - c.usual[i] - whole / 2) / count;
  c.change = change;
  const auto share = static_cast<float>(1 - std::exp(-std::max(0.0, time - c.time) / kForget));
  for (size_t i = 0; i < parts.size(); i++) c.usual[i] += share * (parts[i] - c.usual[i]);
  c.time = time;
}

std::optional<size_t> WaveFinder::found() const {
  size_t most = 0;
  double next = 0;
  for (size_t i = 1; i < cameras_.size(); i++)
    if (cameras_[i].change > cameras_[most].change) most = i;
  for (size_t i = 0; i < cameras_.size(); i++)
    if (i != most) next = std::max(next, cameras_[i].change);
  if (cameras_.empty() || cameras_[most].change < kLeast || cameras_[most].change < kStandsOut * next)
    return std::nullopt;
  return most;
}

}  // namespace lf
