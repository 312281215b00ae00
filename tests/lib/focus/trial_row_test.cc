// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/trial_row.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "focus/boxed_luma.h"
#include "focus/moments.h"
#include "reference/generators.h"

namespace lf {
namespace {

// Positions as project_trial() has them, sampled and added one after the other: the same sums to the bit, of any nodes
// of rows of any length, and none of others.
TEST(TrialRow, SumsAreThoseOfItsPositions) {
  reference::Random random(5);
  constexpr int kWidth = 60, kHeight = 40;
  BoxedLuma boxed;
  Image image(PixelFamily::kI420, kWidth, kHeight);
  for (uint8_t& value : image.data()) value = static_cast<uint8_t>(random.uniform(0, 256));
  box_luma(image.view(), {8, 4, 50, 36}, boxed);
  const TrialLuma luma{boxed.values.data(), 8.5f, 4.5f, 42, 32};
  size_t seen_at_all = 0;
  for (int count = 1; count < 70; count++) {
    TrialProjection projection{};
    for (int k = 0; k < 9; k++) {
      projection.base[k] = static_cast<float>((k % 4 == 0) + random.uniform(-0.05, 0.05));
      projection.slope[k] = static_cast<float>(random.uniform(-0.3, 0.3));
    }
    projection.fx = projection.fy = 50;
    projection.cx = 29;
    projection.cy = 20;
    projection.distorted = count % 2;
    projection.k1 = -0.1f;
    projection.k2 = 0.01f;
    projection.p1 = projection.p2 = 1e-3f;
    projection.max_r2 = 0.3f;
    projection.width = kWidth;
    projection.height = kHeight;
    projection.per_level = 1 / 255.f;
    projection.eye_distance = static_cast<float>(random.uniform(-1, 1.3));
    std::vector<float> u(count), v(count), weight(count), x(count), y(count);
    std::vector<uint8_t> levels(count), seen(count);
    for (int i = 0; i < count; i++) {
      u[i] = static_cast<float>(random.uniform(-0.7, 0.7));
      v[i] = static_cast<float>(random.uniform(-0.5, 0.5));
      weight[i] = static_cast<float>(i % 5 == 0 ? 0 : random.uniform(0, 1));
      levels[i] = static_cast<uint8_t>(random.uniform(0, 256));
    }
    const int first = count / 7, end = count - count / 5;
    const TrialNodes nodes{u.data(), v.data(), weight.data(), first, end, count};
    Moments sums;
    sums.reset(count, 1);
    sums.weight[count / 2] = 60000;  // saturates
    Moments expected = sums;
    const TrialSums one{levels.data(), sums.weight.data(), sums.luma.data(), sums.square.data()};
    add_trials(projection, nodes, luma, &one, 1);
    project_trial(projection, nodes, levels.data(), x.data(), y.data(), seen.data());
    for (int i = first; i < end; i++) {
      if (!seen[i]) continue;
      seen_at_all++;
      const auto fixed = [](float at, int size) {
        return static_cast<int>(std::clamp(at, 0.f, static_cast<float>(size - 1)) * 256);
      };
      const int fx = fixed(x[i] - luma.left, luma.width), fy = fixed(y[i] - luma.top, luma.height);
      const auto at = [&](int dx, int dy) {
        return boxed.values[std::min((fy >> 8) + dy, 31) * 42 + std::min((fx >> 8) + dx, 41)];
      };
      const int ax = fx & 255, ay = fy & 255;
      const int upper = at(0, 0) * (256 - ax) + at(1, 0) * ax, lower = at(0, 1) * (256 - ax) + at(1, 1) * ax;
      const auto value = static_cast<float>((upper * (256 - ay) + lower * ay + (1 << 15)) >> 16);
      const auto add = [](uint16_t& sum, float more) {
        sum = static_cast<uint16_t>(std::min(sum + static_cast<int>(more + 0.5f), 65535));
      };
      add(expected.weight[i], weight[i] * Moments::kWeightOne);
      add(expected.luma[i], weight[i] * value * Moments::kLumaOne);
      add(expected.square[i], weight[i] * value * value);
    }
    EXPECT_EQ(sums.weight, expected.weight) << count;
    EXPECT_EQ(sums.luma, expected.luma) << count;
    EXPECT_EQ(sums.square, expected.square) << count;
  }
  EXPECT_GT(seen_at_all, 500u);
}

// Against the quotient in double precision, along a face of which one edge function ends at 0.
TEST(TrialRow, WeightsAreQuotientsOfEdgeFunctions) {
  const double edge[3] = {1e-3, 2e-4, 7e-5}, step[3] = {-1e-3 / 37, 3e-6, 1e-6};
  float out[38];
  for (int corner = 0; corner < 3; corner++) {
    weigh_run(edge, step, corner, 38, out);
    for (int i = 0; i < 38; i++) {
      double sum = 0;
      for (int k = 0; k < 3; k++) sum += edge[k] + i * step[k];
      EXPECT_NEAR(out[i], std::max(edge[corner] + i * step[corner], 0.0) / sum, 1e-6);
    }
  }
}

}  // namespace
}  // namespace lf
