// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/rays.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace lf {
namespace {

constexpr int kWidth = 70, kHeight = 50;

// The bounding rectangle of the pixels in which every half-plane is >= 0, by looking at each.
Rect brute_force(const Rays& rays, const std::vector<Vec3>& half_planes) {
  Rect rect;
  for (int y = 0; y < kHeight; y++)
    for (int x = 0; x < kWidth; x++) {
      const Vec3 d(rays.at(x, y), 1);
      bool inside = !std::isnan(d.x);
      for (const Vec3& h : half_planes) inside = inside && glm::dot(h, d) >= 0;
      if (inside) rect = unite(rect, {x, y, x + 1, y + 1});
    }
  return rect;
}

bool holds(const Rect& outer, const Rect& inner) { return inner.empty() || unite(outer, inner) == outer; }

class RegionBoundsTest : public testing::TestWithParam<double> {};  // k1 of the view's lens

TEST_P(RegionBoundsTest, HoldsEveryPixelAndLittleMore) {
  const Lens lens(LensModel::kSimpleRadial, {60, (kWidth - 1) / 2.0, (kHeight - 1) / 2.0, GetParam()});
  const Rays rays(lens, kWidth, kHeight);
  const RegionBounds bounds(rays, lens, kWidth, kHeight);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> normal(-1, 1);
  int seen = 0;
  for (int i = 0; i < 3000; i++) {
    std::vector<Vec3> half_planes;
    for (int k = 0; k < 1 + i % 4; k++) half_planes.emplace_back(normal(random), normal(random), 0.4 * normal(random));
    const Rect exact = brute_force(rays, half_planes), bound = bounds.bound(half_planes);
    ASSERT_TRUE(holds(bound, exact)) << i;
    if (exact.empty()) continue;
    seen++;
    // Corners of the region between pixel centres make a pinhole's bound up to a few pixels larger on slivers;
    // a distorted one's grows to whole tiles.
    const bool pinhole = GetParam() == 0;
    EXPECT_LE(bound.width() * bound.height(), pinhole ? exact.width() * exact.height() * 2 + 400 : kWidth * kHeight)
        << i;
  }
  EXPECT_GT(seen, 1000);
}

INSTANTIATE_TEST_SUITE_P(Lenses, RegionBoundsTest, testing::Values(0.0, -0.2, 0.3));

// Groups of tiles are passed over where none of them holds a pixel: each tile alone says the same.
TEST(RegionBounds, GroupsOfTilesChangeNothing) {
  constexpr int kWide = 400, kTall = 300, kTile = 16;
  const Lens lens(LensModel::kRadial, {150, 180, 140, -0.3, 0.05});
  const Rays rays(lens, kWide, kTall);
  const RegionBounds bounds(rays, lens, kWide, kTall);
  std::mt19937 random(6);
  std::uniform_real_distribution<double> normal(-1, 1);
  int smaller = 0;
  for (int i = 0; i < 1000; i++) {
    std::vector<Vec3> half_planes;
    for (int k = 0; k < 1 + i % 4; k++) half_planes.emplace_back(normal(random), normal(random), 0.4 * normal(random));
    Rect by_tiles;
    for (int y = 0; y < kTall; y += kTile)
      for (int x = 0; x < kWide; x += kTile) {
        const Rect tile = intersect({x, y, x + kTile, y + kTile}, {0, 0, kWide, kTall});
        Vec2 low(INFINITY), high(-INFINITY);
        for (int py = tile.y0; py < tile.y1; py++)
          for (int px = tile.x0; px < tile.x1; px++)
            if (const Vec2 ray = rays.at(px, py); !std::isnan(ray.x)) {
              low = glm::min(low, ray);
              high = glm::max(high, ray);
            }
        const auto may_hold = [&](const Vec3& h) {
          return h.x * (h.x > 0 ? high.x : low.x) + h.y * (h.y > 0 ? high.y : low.y) + h.z >= -1e-12;
        };
        if (low.x <= high.x && std::ranges::all_of(half_planes, may_hold)) by_tiles = unite(by_tiles, tile);
      }
    ASSERT_EQ(bounds.bound(half_planes), by_tiles) << i;
    smaller += by_tiles != Rect{0, 0, kWide, kTall};
  }
  EXPECT_GT(smaller, 500);
}

TEST(RegionBounds, NoHalfPlanesIsTheWholeView) {
  const Lens lens = Lens::pinhole(60, 34.5, 24.5);
  const Rays rays(lens, kWidth, kHeight);
  EXPECT_EQ(RegionBounds(rays, lens, kWidth, kHeight).bound({}), (Rect{0, 0, kWidth, kHeight}));
}

TEST(RegionBounds, EdgesThroughPixelCentresAreInside) {
  const Lens lens = Lens::pinhole(50, 0, 0);
  const Rays rays(lens, kWidth, kHeight);
  const RegionBounds bounds(rays, lens, kWidth, kHeight);
  const Vec3 half_planes[] = {{1, 0, -10 / 50.0}, {-1, 0, 20 / 50.0}, {0, 1, -5 / 50.0}, {0, -1, 5 / 50.0}};
  EXPECT_EQ(bounds.bound(half_planes), (Rect{10, 5, 21, 6}));
}

// Numbers off a network may be as large as doubles are.
TEST(RegionBounds, OverflowsBoundNothing) {
  const Lens lens = Lens::pinhole(60, (kWidth - 1) / 2.0, (kHeight - 1) / 2.0);
  const Rays rays(lens, kWidth, kHeight);
  const RegionBounds bounds(rays, lens, kWidth, kHeight);
  constexpr double kInf = std::numeric_limits<double>::infinity();
  for (const Vec3& h :
       {Vec3(1e308, 1e308, -1e308) * 10.0, Vec3(kInf, 0, -1), Vec3(NAN, 0, 1), Vec3(0, 1e308, 1.7e308)}) {
    const std::vector<Vec3> half_planes{{1, 0, 0.2}, h};
    EXPECT_EQ(bounds.bound(half_planes), (Rect{0, 0, kWidth, kHeight}));
  }
}

TEST(RegionBounds, StayInTheViewWhereverItsCentreIs) {
  for (const double centre : {3e85, -3e85, 3e9, -3e9}) {
    const Lens lens = Lens::pinhole(60, centre, centre);
    const Rays rays(lens, kWidth, kHeight);
    const std::vector<Vec3> half_planes{{1, 0.5, 0.2}};
    const Rect bound = RegionBounds(rays, lens, kWidth, kHeight).bound(half_planes);
    EXPECT_TRUE(holds(bound, brute_force(rays, half_planes))) << centre;
    EXPECT_TRUE(bound.empty() || holds({0, 0, kWidth, kHeight}, bound)) << centre;
  }
}

}  // namespace
}  // namespace lf
