// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/hypothesis_projection.h"

#include "lib/focus/random_rays.h"
#include "lib/render/sum_arrays.h"
#include "support/every_target.h"
#include "support/test.h"

namespace lf {
namespace {

TEST(HypothesisRow, FixedPointPlacesMatchPositions) {
  reference::Random random(5);
  size_t seen_at_all = 0;
  for (int count = 1; count < 70; count++) {
    const test::RandomRays first(random, count);
    test::RandomRays second = first;
    std::ranges::reverse(second.levels);
    std::vector<uint8_t> levels(first.levels);
    levels.insert(levels.end(), second.levels.begin(), second.levels.end());
    test::on_every_target([&] {
      std::vector<int32_t> x(levels.size()), y(levels.size());
      const PlaceBounds bounds = place_hypotheses(first.projection, first.rays(), levels.data(), 2, x.data(), y.data());
      PlaceBounds expected;
      for (size_t t = 0; t < 2; t++) {
        const std::vector<test::Position> positions = (t == 0 ? first : second).positions();
        for (int i = 0; i < count; i++) {
          const auto [seen, px, py] = positions[i];
          const size_t at = t * first.levels.size() + i;
          const int left = seen ? test::in_256ths(px, test::RandomRays::kWidth) : -1;
          const int top = seen ? test::in_256ths(py, test::RandomRays::kHeight) : -1;
          EXPECT_EQ(x[at], left);
          if (!seen) continue;
          EXPECT_EQ(y[at], top);
          seen_at_all++;
          expected = {std::min(expected.left, left), std::min(expected.top, top), std::max(expected.right, left),
                      std::max(expected.bottom, top)};
        }
      }
      EXPECT_EQ(bounds.left, expected.left);
      EXPECT_EQ(bounds.top, expected.top);
      EXPECT_EQ(bounds.right, expected.right);
      EXPECT_EQ(bounds.bottom, expected.bottom);
    });
  }
  EXPECT_GT(seen_at_all, 500u);
}

TEST(HypothesisRow, PositionsMatchEveryLens) {
  reference::Random random(6);
  for (const Lens& lens : test::lenses_beyond_opencv(test::RandomRays::kWidth, test::RandomRays::kHeight)) {
    test::RandomRays rays(random, 300);
    rays.projection = {.base = {1, 0, 0, 0, 1, 0, 0, 0, 1},
                       .fx = static_cast<float>(lens.fx()),
                       .fy = static_cast<float>(lens.fy()),
                       .cx = static_cast<float>(lens.cx()),
                       .cy = static_cast<float>(lens.cy()),
                       .distortion = lens.distortion().as<float>(),
                       .is_distorted = true,
                       .width = test::RandomRays::kWidth,
                       .height = test::RandomRays::kHeight};
    for (int i = 0; i < rays.count; i++) {
      rays.u[i] *= i % 3 ? 1 : 20;
      rays.v[i] *= i % 3 ? 1 : 20;
    }
    test::on_every_target([&] {
      const std::vector<test::Position> positions = rays.positions();
      for (int i = 0; i < rays.count; i++) {
        const std::optional<Vec2> expected = lens.distort({rays.u[i], rays.v[i]});
        if (!expected) {
          EXPECT_FALSE(positions[i].seen) << "beyond the fold";
          continue;
        }
        const double x = lens.fx() * expected->x + lens.cx(), y = lens.fy() * expected->y + lens.cy();
        const double outside =
            std::max({-0.5 - x, x + 0.5 - test::RandomRays::kWidth, -0.5 - y, y + 0.5 - test::RandomRays::kHeight});
        EXPECT_TRUE(std::abs(outside) <= 1e-4 || positions[i].seen == (outside < 0));
        if (!positions[i].seen) continue;
        EXPECT_NEAR(positions[i].x, x, 1e-4);
        EXPECT_NEAR(positions[i].y, y, 1e-4);
      }
    });
  }
}

// Compares with the quotient in double precision, along a face with one edge function ending at 0.
TEST(HypothesisRow, WeightsAreQuotientsOfEdgeFunctions) {
  const double edge[3] = {1e-3, 2e-4, 7e-5}, step[3] = {-1e-3 / 37, 3e-6, 1e-6};
  float out[38 + kHypothesisPadding];
  for (int corner = 0; corner < 3; corner++) {
    weigh_run(edge, step, corner, 38, out);
    for (int i = 0; i < 38; i++) {
      double sum = 0;
      for (int k = 0; k < 3; k++) sum += edge[k] + i * step[k];
      EXPECT_NEAR(out[i], std::max(edge[corner] + i * step[corner], 0.0) / sum, 1e-6);
    }
  }
}

// Edge functions of one sign along a run, in double precision; some nearly vanish at the ends.
TEST(HypothesisRow, WeightsAreWithinTheErrorBound) {
  reference::Random random(7);
  double worst = 0;
  for (int run = 0; run < 3000; run++) {
    const int n = 2 + static_cast<int>(random.uniform(0, 100)), corner = run % 3;
    const double scale = std::exp(random.uniform(-15, 15)) * (run % 2 ? 1 : -1);
    double edge[3], step[3];
    for (int k = 0; k < 3; k++) {
      const auto end = [&] { return std::exp(random.uniform(-12, 0)); };
      const double first = end(), last = end();
      edge[k] = scale * first;
      step[k] = scale * (last - first) / (n - 1);
    }
    std::vector<float> weight(n + kHypothesisPadding);
    weigh_run(edge, step, corner, n, weight.data());
    const double first_sum = edge[0] + edge[1] + edge[2];
    for (int i = 0; i < n; i++) {
      const double sum = first_sum + i * (step[0] + step[1] + step[2]);
      const double bound = std::ldexp(6 * std::max(first_sum / sum, 1.0) + 3, -24);
      const double error = std::abs(weight[i] - (edge[corner] + i * step[corner]) / sum);
      EXPECT_LE(error, bound) << "run " << run << ", node " << i << " of " << n;
      worst = std::max(worst, error / bound);
    }
  }
  EXPECT_GT(worst, 0.2) << "the bound is tight";
}

}  // namespace

}  // namespace lf
