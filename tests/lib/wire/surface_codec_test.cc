// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/surface_codec.h"

#include "base/text.h"
#include "support/test.h"
#include "view/navigator.h"

namespace lf::wire {
namespace {

class SurfaceCodecTest : public testing::Test {
 protected:
  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random_); }
  int integer(int from, int to) { return std::uniform_int_distribution<int>(from, to)(random_); }

  View view(int width = 640, int height = 480) {
    Viewpoint from;
    from.pose.position = Vec3(uniform(-1, 1), uniform(-1, 1), uniform(-0.2, 0.2));
    from.pose.orientation = quat_from_euler({uniform(-20, 20), uniform(-20, 20), uniform(-180, 180)});
    from.fov_y_deg = uniform(20, 80);
    from.focus_distance = uniform(0.5, 5);
    return make_view(from, width, height);
  }
  // A surface of smooth parts with sharp edges. Its reference plane is near the view.
  View mapped_view(int width = 640, int height = 480, int step = 8) {
    View made = view(width, height);
    FocalMap map = FocalMap::for_view(width, height, step);
    map.from = plane_through(Vec3(0, 0, uniform(-0.5, 0.2)), glm::normalize(Vec3(uniform(-0.1, 0.1), 0, 1)));
    map.nearest = uniform(0.5, 1);
    const int edge = map.columns / 3;
    for (int j = 0; j < map.rows; j++)
      for (int i = 0; i < map.columns; i++)
        map.levels.push_back(static_cast<uint8_t>(i < edge ? 200 + 10 * i / map.columns : 20 + 60 * j / map.rows));
    made.focus.map = std::make_shared<FocalMap>(std::move(map));
    return made;
  }

  std::mt19937 random_{7};
};

Vec3 point_of(const PictureSurface& s, int i, int j) {
  const double x = (i + 0.5) * s.step - 0.5, y = (j + 0.5) * s.step - 0.5;
  const double level = s.levels[static_cast<size_t>(j * s.columns + i)];
  const double depth = 1 / (s.farthest + (s.nearest - s.farthest) * level / 255);
  return s.pose.world_from_camera(depth * Vec3((x - s.cx) / s.fx, (y - s.cy) / s.fy, 1));
}

TEST_F(SurfaceCodecTest, MapKeepsItsPlaceInTheWorld) {
  for (int trial = 0; trial < 20; trial++) {
    const View shown = mapped_view();
    const FocalMap& map = *shown.focus.map;
    const auto surface = picture_surface(shown, 1);
    ASSERT_TRUE(surface);
    EXPECT_EQ(surface->step, map.step);
    ASSERT_EQ(surface->levels.size(), map.levels.size());
    // The error of half a level, as an inverse distance, at the largest magnification by the reference plane.
    const double bound = 2 * (surface->nearest - surface->farthest) / 255;
    for (int j = 0; j < surface->rows; j += 3)
      for (int i = 0; i < surface->columns; i++) {
        const double distance = map.from.signed_distance(point_of(*surface, i, j));
        const double expected = map.inverse_of(map.levels[static_cast<size_t>(j * map.columns + i)]);
        ASSERT_NEAR(1 / distance, expected, bound) << "node " << i << ", " << j;
      }
  }
}

TEST_F(SurfaceCodecTest, PerpendicularPlaneIsASingleDepth) {
  const View flat = view();
  const auto surface = picture_surface(flat, 1);
  ASSERT_TRUE(surface);
  EXPECT_EQ(surface->levels.size(), 1u);
  const double distance = std::abs(flat.focus.plane.signed_distance(flat.pose.position));
  EXPECT_NEAR(1 / surface->farthest, distance, 1e-6 * distance);  // in single precision
  EXPECT_LT(encode_surface(*surface).size(), PictureSurface::kHeaderBytes + 12);
}

TEST_F(SurfaceCodecTest, InclinedPlaneHasAGrid) {
  View inclined = view();
  inclined.focus.plane.normal = glm::normalize(inclined.focus.plane.normal + 0.3 * inclined.pose.down());
  const auto surface = picture_surface(inclined, 1);
  ASSERT_TRUE(surface);
  ASSERT_GT(surface->levels.size(), 100u);
  for (int j = 0; j < surface->rows; j++)
    EXPECT_NEAR(inclined.focus.plane.signed_distance(point_of(*surface, 3, j)) * surface->nearest, 0, 0.02) << j;
}

TEST_F(SurfaceCodecTest, SurfacesBehindTheViewAreFar) {
  View turned = view();
  turned.focus.plane = plane_through(turned.pose.position - turned.pose.forward(), turned.pose.forward());
  EXPECT_EQ(picture_surface(turned, 1)->nearest, 0);
  turned.focus.plane = plane_through(turned.pose.position, turned.pose.forward());
  EXPECT_EQ(picture_surface(turned, 1)->nearest, 0);
}

TEST_F(SurfaceCodecTest, LensesWithDistortionHaveNoSurface) {
  View wide = view();
  wide.lens = Lens(LensModel::kSimpleRadial, {500, 319.5, 239.5, 0.1});
  EXPECT_FALSE(picture_surface(wide, 1));
}

TEST_F(SurfaceCodecTest, RoundTrip) {
  for (const auto& [width, height] :
       {std::pair(640, 480), std::pair(641, 479), std::pair(64, 64), std::pair(3000, 2000)})
    for (const int step : {4, 8, 16}) {
      auto surface = picture_surface(mapped_view(width, height, step), 0xfedcba98);
      ASSERT_TRUE(surface);
      ASSERT_LE(surface->levels.size(), PictureSurface::kMaxNodes);
      do {
        for (uint8_t& level : surface->levels)
          if (integer(0, 3) == 0) level = static_cast<uint8_t>(integer(0, 255));
        std::string reason;
        const auto again = decode_surface(encode_surface(*surface), &reason);
        ASSERT_TRUE(again) << reason;
        ASSERT_EQ(*again, *surface);
      } while (halve(*surface));
    }
}

TEST_F(SurfaceCodecTest, SmoothSurfacesAreShort) {
  const auto surface = picture_surface(mapped_view(), 1);
  EXPECT_EQ(surface->levels.size(), 4800u);
  EXPECT_LT(encode_surface(*surface).size(), 600u);
}

// Every level is within the tolerance, and messages get shorter. A decoded surface is encoded without further changes.
TEST_F(SurfaceCodecTest, LevelsStayWithinTheTolerance) {
  for (int trial = 0; trial < 20; trial++) {
    auto surface = picture_surface(mapped_view(), 1);
    const int noise = integer(1, 60);
    for (uint8_t& level : surface->levels)
      level = static_cast<uint8_t>(std::clamp(level + integer(-noise, noise), 0, 255));
    size_t before = SIZE_MAX;
    for (const int tolerance : {0, 1, 2, 4, PictureSurface::kMaxTolerance}) {
      surface->tolerance = tolerance;
      const std::vector<uint8_t> bytes = encode_surface(*surface);
      EXPECT_LT(bytes.size(), before);
      before = bytes.size();
      const auto decoded = decode_surface(bytes);
      ASSERT_TRUE(decoded);
      EXPECT_EQ(decoded->pose, surface->pose);
      for (size_t i = 0; i < surface->levels.size(); i++)
        ASSERT_LE(std::abs(decoded->levels[i] - surface->levels[i]), tolerance) << i;
      EXPECT_EQ(encode_surface(*decoded), bytes);
    }
  }
}

TEST_F(SurfaceCodecTest, SmoothingRemovesOutliersAndKeepsEdges) {
  auto surface = picture_surface(mapped_view(641, 479, 8), 1);
  for (int j = 0; j < surface->rows; j++)
    for (int i = 0; i < surface->columns; i++)
      surface->levels[static_cast<size_t>(j * surface->columns + i)] = i < 30 ? 200 : 20;
  const std::vector<uint8_t> clean = surface->levels;
  for (size_t at = 5; at < surface->levels.size(); at += 97) surface->levels[at] = 100;
  smooth(*surface);
  EXPECT_EQ(surface->levels, clean);
}

TEST_F(SurfaceCodecTest, HalvingKeepsEdgesSharp) {
  auto surface = picture_surface(mapped_view(), 1);
  const std::vector<uint8_t> before = surface->levels;
  ASSERT_TRUE(halve(*surface));
  EXPECT_EQ(surface->columns, 40);
  EXPECT_EQ(surface->rows, 30);
  for (const uint8_t level : surface->levels)
    ASSERT_TRUE(std::ranges::find(before, level) != before.end()) << int{level};
  while (halve(*surface)) {
  }
  EXPECT_GE(std::min(surface->columns, surface->rows), PictureSurface::kMinNodes);
}

TEST_F(SurfaceCodecTest, InvalidMessagesNameTheField) {
  const std::vector<uint8_t> good = encode_surface(*picture_surface(mapped_view(), 1));
  std::string reason;
  for (size_t size = 0; size < good.size(); size++)
    ASSERT_FALSE(decode_surface(std::span(good).first(size), &reason)) << size;
  const struct {
    size_t at;
    uint8_t value;
    const char* names;
  } cases[] = {{0, 1, "version"},    {1, 2, "view"},       {3, 0, "step"},      {8, 0xff, "width"},
               {12, 9, "tolerance"}, {3, 1, "step"},       {13, 0x7f, "pose"},  {37, 0x40, "pose"},
               {53, 0xbf, "lens"},   {69, 0xbf, "depths"}, {73, 0x7f, "depths"}};
  for (const auto& [at, value, names] : cases) {
    std::vector<uint8_t> bad = good;
    bad[at] = value;
    if (at == 13 || at == 73) bad[at + 1] = 0xf8;  // not a number
    EXPECT_FALSE(decode_surface(bad, &reason)) << names;
    EXPECT_THAT(reason, HasSubstr(names));
  }
  std::vector<uint8_t> longer = good;
  longer.push_back(0);
  EXPECT_FALSE(decode_surface(longer));
}

}  // namespace
}  // namespace lf::wire
