// SPDX-License-Identifier: LGPL-2.1-or-later
#include "geometry/focal_surface.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <memory>

#include "base/error.h"
#include "support/expect_error.h"

namespace lf {
namespace {

FocalMap map_of(int width, int height) {
  FocalMap map = FocalMap::for_view(width, height);
  map.farthest = 0.25;
  map.nearest = 2;
  for (int i = 0; i < map.columns * map.rows; i++) map.levels.push_back(static_cast<uint8_t>(i * 37));
  return map;
}

TEST(FocalMap, HasANodeInTheMiddleOfEachOfItsSquares) {
  const FocalMap map = map_of(22, 13);
  EXPECT_EQ(map.columns, 6);
  EXPECT_EQ(map.rows, 4);
  for (int j = 0; j < map.rows; j++)
    for (int i = 0; i < map.columns; i++)
      EXPECT_NEAR(map.inverse_at(4 * i + 1.5, 4 * j + 1.5), map.inverse_of(map.levels[j * map.columns + i]), 1e-12);
  const double four = map.inverse_of((map.levels[0] + map.levels[1] + map.levels[6] + map.levels[7]) / 4.0);
  EXPECT_NEAR(map.inverse_at(3.5, 3.5), four, 1e-12) << "half-way between four";
  EXPECT_EQ(map.inverse_at(-100, -100), map.inverse_of(map.levels[0])) << "beyond the outer nodes as at them";
}

TEST(FocalMap, RowsArePositionsOneByOne) {
  const FocalMap map = map_of(50, 30);
  for (const double spacing : {1.0, 2.0, 16.0}) {
    float row[40];
    map.inverse_row(-5.5, spacing, 7.25, 40, row);
    for (int i = 0; i < 40; i++) EXPECT_NEAR(row[i], map.inverse_at(-5.5 + i * spacing, 7.25), 1e-6) << i;
  }
}

TEST(FocalMap, LevelsAreTheNearestOnes) {
  const FocalMap map = map_of(8, 8);
  for (int level = 0; level <= 255; level++) EXPECT_EQ(map.level_of(map.inverse_of(level)), level);
  EXPECT_EQ(map.level_of(0), 0);
  EXPECT_EQ(map.level_of(100), 255);
}

TEST(FocalMap, OfALargeViewIsCoarser) {
  const FocalMap map = FocalMap::for_view(16384, 16384);
  EXPECT_EQ(map.step, 16);
  EXPECT_LE(static_cast<size_t>(map.columns) * map.rows, FocalMap::kMaxNodes);
}

TEST(FocalMap, RefinedIsTheSameSurfaceToHalfALevel) {
  for (const auto& [width, height, step] : {std::array{333, 117, 8}, {2048, 96, 16}, {70, 70, 64}, {9, 9, 8}}) {
    FocalMap map = FocalMap::for_view(width, height, step);
    map.farthest = 0.25;
    map.nearest = 2;
    for (int i = 0; i < map.columns * map.rows; i++) map.levels.push_back(static_cast<uint8_t>(i * 37));
    const FocalMap fine = map.refined(width, height);
    ASSERT_EQ(fine.step, FocalMap::kFinestStep);
    EXPECT_NO_THROW(validate({Plane{{0, 0, 1}, 0}, std::make_shared<FocalMap>(fine)}, width, height));
    const double half_a_level = (map.nearest - map.farthest) / FocalMap::kLevels / 2;
    for (int j = 0; j < fine.rows; j++)
      for (int i = 0; i < fine.columns; i++)
        ASSERT_NEAR(fine.inverse_of(fine.levels[j * fine.columns + i]), map.inverse_at(4 * i + 1.5, 4 * j + 1.5),
                    half_a_level + 1e-12)
            << width << "x" << height << " by " << step << ": " << i << ", " << j;
  }
}

TEST(FocalMap, OfTheFinestStepOrOfNoMultipleOfItIsNotRefined) {
  for (const int step : {1, 4, 6, 63}) {
    FocalMap map = FocalMap::for_view(100, 50, step);
    map.nearest = 1;
    map.levels.assign(static_cast<size_t>(map.columns * map.rows), 7);
    EXPECT_EQ(map.refined(100, 50), map) << step;
  }
}

TEST(FocalSurface, NamesWhatIsWrong) {
  const auto with = [](const std::function<void(FocalMap&)>& change) {
    FocalMap map = map_of(22, 13);
    change(map);
    return FocalSurface{{{0, 0, 1}, -2}, std::make_shared<FocalMap>(map)};
  };
  EXPECT_NO_THROW(validate(with([](FocalMap&) {}), 22, 13));
  const std::function<void(FocalMap&)> bad[] = {
      [](FocalMap& m) { m.step = 0; },
      [](FocalMap& m) { m.step = 65; },
      [](FocalMap& m) { m.columns++; },
      [](FocalMap& m) { m.levels.pop_back(); },
      [](FocalMap& m) { m.farthest = -1; },
      [](FocalMap& m) { m.nearest = m.farthest; },
      [](FocalMap& m) { m.nearest = INFINITY; },
      [](FocalMap& m) { m.farthest = NAN; },
      [](FocalMap& m) {
        m.from.normal = {0, 0, 2};
      },
      [](FocalMap& m) { m.from.d = NAN; },
  };
  for (const auto& change : bad) EXPECT_ERROR(validate(with(change), 22, 13), "focal_map: ");
}

TEST(FocalSurface, IsComparedByWhatItSays) {
  const auto a = std::make_shared<FocalMap>(map_of(22, 13)), b = std::make_shared<FocalMap>(map_of(22, 13));
  EXPECT_EQ((FocalSurface{{}, a}), (FocalSurface{{}, b}));
  b->levels[3]++;
  EXPECT_NE((FocalSurface{{}, a}), (FocalSurface{{}, b}));
  EXPECT_NE((FocalSurface{{}, a}), (FocalSurface{{}, nullptr}));
}

}  // namespace
}  // namespace lf
