// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <vector>

#include "focus/hypothesis_projection.h"
#include "reference/generators.h"

namespace lf::test {

struct Position {
  bool seen;
  float x, y;
};

// A camera of 60 x 40 pixels, and nodes that it sees in part.
struct RandomRays {
  static constexpr int kWidth = 60, kHeight = 40;
  RandomRays(reference::Random& random, int nodes)
      : count(nodes), u(nodes + kHypothesisPadding), v(u), weight(u), levels(nodes + kHypothesisPadding) {
    for (int k = 0; k < 9; k++) {
      projection.base[k] = static_cast<float>((k % 4 == 0) + random.uniform(-0.05, 0.05));
      projection.slope[k] = static_cast<float>(random.uniform(-0.3, 0.3));
    }
    projection.fx = projection.fy = 50;
    projection.cx = 29;
    projection.cy = 20;
    projection.is_distorted = count % 2;
    projection.distortion.k = {-0.1f, 0.01f};
    projection.distortion.p1 = projection.distortion.p2 = 1e-3f;
    projection.distortion.is_tangential = true;
    projection.distortion.limit = 0.3f;
    projection.width = kWidth;
    projection.height = kHeight;
    projection.per_level = 1 / 255.f;
    projection.eye_distance = static_cast<float>(random.uniform(-1, 1.3));
    for (int i = 0; i < count; i++) {
      u[i] = static_cast<float>(random.uniform(-0.7, 0.7));
      v[i] = static_cast<float>(random.uniform(-0.5, 0.5));
      weight[i] = static_cast<float>(i % 5 == 0 ? 0 : random.uniform(0, 1));
      levels[i] = static_cast<uint8_t>(random.uniform(0, 256));
    }
  }
  HypothesisRays rays() const { return {u.data(), v.data(), count}; }
  std::vector<Position> positions() const {
    std::vector<float> x(count), y(count);
    std::vector<uint8_t> seen(count);
    project_hypothesis(projection, rays(), levels.data(), x.data(), y.data(), seen.data());
    std::vector<Position> out;
    for (int i = 0; i < count; i++) out.push_back({seen[i] != 0, x[i], y[i]});
    return out;
  }

  int count;
  HypothesisProjection projection{};
  std::vector<float> u, v, weight;
  std::vector<uint8_t> levels;
};

// A position within `size` values of a BoxedLuma.
inline int in_256ths(float at, int size) {
  return static_cast<int>(std::clamp(at - 0.5f, 0.f, static_cast<float>(size - 1)) * 256);
}

}  // namespace lf::test
