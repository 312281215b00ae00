// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/colour_samples.h"

#include <algorithm>
#include <cmath>

namespace lf {

std::optional<ColourSample> sample_quad(const Image& rgb, const std::array<Vec2, 4>& corners) {
  Vec2 low = corners[0], high = corners[0], middle(0);
  for (const Vec2& corner : corners) {
    low = glm::min(low, corner);
    high = glm::max(high, corner);
    middle += corner / 4.0;
  }
  if (!(low.x >= 0 && low.y >= 0 && high.x <= rgb.width() - 1 && high.y <= rgb.height() - 1)) return std::nullopt;
  double turn = 0;  // which way round the corners go
  for (size_t i = 0; i < 4; i++) {
    const Vec2 a = corners[i], b = corners[(i + 1) % 4];
    turn += a.x * b.y - b.x * a.y;
  }
  const auto is_inside = [&](const Vec2& p) {
    for (size_t i = 0; i < 4; i++) {
      const Vec2 a = corners[i], b = corners[(i + 1) % 4];
      if (((b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x)) * turn < 0) return false;
    }
    return true;
  };
  size_t count = 0, clipped[3] = {};
  Vec3 sum(0), squares(0);
  for (int y = static_cast<int>(std::ceil(low.y)); y <= static_cast<int>(high.y); y++)
    for (int x = static_cast<int>(std::ceil(low.x)); x <= static_cast<int>(high.x); x++) {
      if (!is_inside({x, y})) continue;
      count++;
      for (int c = 0; c < 3; c++) {
        const int level = rgb.pixel(x, y)[c];
        sum[c] += level;
        squares[c] += level * level;
        clipped[c] += level <= 2 || level >= 253;
      }
    }
  if (count < 9) return std::nullopt;
  const auto n = static_cast<double>(count);
  ColourSample sample{.place = middle, .level = sum / n};
  double variance = 0;
  for (int c = 0; c < 3; c++) {
    sample.usable[static_cast<size_t>(c)] = static_cast<double>(clipped[c]) <= 0.01 * n;
    variance = std::max(variance, squares[c] / n - sample.level[c] * sample.level[c]);
  }
  // Beside the noise there is what levels are rounded to, and what is not quite the same place in all cameras.
  sample.sigma = std::sqrt(0.1 + variance / n + 0.001 * variance);
  return sample;
}

}  // namespace lf
