// SPDX-License-Identifier: LGPL-2.1-or-later

#include <glm/geometric.hpp>

#include "scene/objects.h"
#include "scene/scene.h"
#include "support/test.h"

namespace lf::scene {

namespace {

TEST(Objects, AreInsideTheRoom) {
  const auto inside = [](const V3& p, float r) {
    constexpr float kSlack = 0.001f;
    for (int axis = 0; axis < 3; axis++)
      if (p[axis] - r < kRoomMin[axis] - kSlack || p[axis] + r > kRoomMax[axis] + kSlack) return false;
    return true;
  };
  for (double time = 0; time < kScenePeriod; time += 0.21) {
    const Objects o = objects_at(time);
    for (const Sphere& s : o.spheres) EXPECT_TRUE(inside(s.centre, s.radius)) << "sphere at " << time;
    for (const Box& b : o.boxes) EXPECT_TRUE(inside(b.centre, b.half.y)) << "block at " << time;
    for (const Cylinder& p : o.cylinders) {
      EXPECT_LT(p.top, p.bottom);
      EXPECT_TRUE(inside({p.x, p.bottom, p.z}, 0));
    }
  }
}

TEST(Objects, GroupsContainEachSphereAndCapsuleOnce) {
  const Objects o = objects_at(1.3);
  std::vector<int> spheres(o.spheres.size()), capsules(o.capsules.size());
  for (const Group& g : o.groups) {
    const auto expect_held = [&](const V3& p, float r) { EXPECT_LE(glm::length(p - g.centre) + r, g.radius); };
    for (uint32_t i = g.first_sphere; i < g.last_sphere; i++) {
      spheres[i]++;
      expect_held(o.spheres[i].centre, o.spheres[i].radius);
    }
    for (uint32_t i = g.first_capsule; i < g.last_capsule; i++) {
      capsules[i]++;
      expect_held(o.capsules[i].base, o.capsules[i].radius);
      expect_held(o.capsules[i].base + o.capsules[i].axis, o.capsules[i].radius);
    }
  }
  EXPECT_EQ(spheres, std::vector<int>(spheres.size(), 1));
  EXPECT_EQ(capsules, std::vector<int>(capsules.size(), 1));
}

TEST(Objects, MoveWithThePeriodOfTheScene) {
  const Objects now = objects_at(0.7), later = objects_at(0.7 + kScenePeriod), between = objects_at(0.7 + 1.1);
  float moved = 0;
  for (size_t i = 0; i < now.spheres.size(); i++) {
    EXPECT_LT(glm::length(now.spheres[i].centre - later.spheres[i].centre), 1e-5f);
    moved = std::max(moved, glm::length(now.spheres[i].centre - between.spheres[i].centre));
  }
  EXPECT_GT(moved, 0.3f);
}

TEST(Objects, SpeedIsLimited) {
  constexpr double kStep = 0.005;
  float fastest = 0;
  for (double time = 0; time < kScenePeriod; time += 0.05) {
    const Objects a = objects_at(time), b = objects_at(time + kStep);
    for (size_t i = 0; i < a.spheres.size(); i++)
      fastest = std::max(fastest, glm::length(a.spheres[i].centre - b.spheres[i].centre) / static_cast<float>(kStep));
  }
  EXPECT_GT(fastest, 0.3f);
  EXPECT_LT(fastest, 1.2f);
}

Objects figure_at(double time) {
  Objects o;
  add_figure(time, o);
  return o;
}

float lowest(const Objects& o) {
  float y = -1e9f;
  for (const Sphere& s : o.spheres) y = std::max(y, s.centre.y + s.radius);
  for (const Capsule& c : o.capsules) y = std::max({y, c.base.y + c.radius, c.base.y + c.axis.y + c.radius});
  return y;
}

TEST(Figure, WalksOnTheFloor) {
  for (double time = 0; time < kScenePeriod; time += 0.03) EXPECT_NEAR(lowest(figure_at(time)), kFloor, 0.012) << time;
}

TEST(Figure, LimbsKeepTheirLengths) {
  // Bones are rigid: no capsule may stretch, except for the last, the balloon's string.
  const Objects first = figure_at(0);
  for (double time = 0.1; time < kScenePeriod; time += 0.17) {
    const Objects o = figure_at(time);
    ASSERT_EQ(o.capsules.size(), first.capsules.size());
    for (size_t i = 0; i + 1 < o.capsules.size(); i++)
      EXPECT_NEAR(glm::length(o.capsules[i].axis), glm::length(first.capsules[i].axis), 0.012) << i << " at " << time;
  }
}

TEST(Figure, StaysNearTheMiddleDepth) {
  float near = 1e9f, far = 0;
  for (double time = 0; time < kScenePeriod; time += 0.1)
    for (const Group& g : figure_at(time).groups) {
      near = std::min(near, g.centre.z);
      far = std::max(far, g.centre.z);
    }
  EXPECT_GT(near, kSceneMiddle - 0.3);
  EXPECT_LT(far, kSceneMiddle + 0.4);
  EXPECT_GT(far - near, 0.15f);
}

template <typename F>
double mean(F&& f, double x, double w) {
  constexpr int kSteps = 4000;
  double sum = 0;
  for (int i = 0; i < kSteps; i++) sum += f(x + w * ((i + 0.5) / kSteps - 0.5));
  return sum / kSteps;
}

double fraction(double x) { return x - std::floor(x); }

TEST(Pattern, CosineOfTurns) {
  for (double x = -7; x < 7; x += 0.0137) EXPECT_NEAR(cos_turns(static_cast<float>(x)), std::cos(2 * M_PI * x), 2e-4);
}

TEST(Pattern, Floor) {
  for (const float x : {-3.0f, -2.5f, -0.25f, 0.0f, 0.5f, 0.999f, 1.0f, 1.5f, 1000.75f})
    EXPECT_EQ(floor_of(x), std::floor(x)) << x;
}

TEST(Pattern, FilteredPatternsAreAverages) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> position(-4, 4), width(0.01f, 3);
  for (int i = 0; i < 200; i++) {
    const float x = position(random), w = width(random);
    EXPECT_NEAR(stripes(x, w, 0.3f), mean([](double v) { return fraction(v) < 0.3 ? 1 : 0; }, x, w), 2e-3);
    if (w < 1) {
      EXPECT_NEAR(wave(x, w), mean([](double v) { return std::cos(2 * M_PI * v); }, x, w), 6e-3);
    }
    const float y = position(random), wy = width(random);
    const auto sign = [](double v) { return fraction(v / 2) < 0.5 ? 1.0 : -1.0; };
    EXPECT_NEAR(checker(x, w, y, wy), 0.5 + 0.5 * mean(sign, x, w) * mean(sign, y, wy), 4e-3);
  }
}

TEST(Pattern, FineTextureFadesToItsMean) {
  EXPECT_EQ(wave(0.3f, 1), 0);
  EXPECT_NEAR(checker(0.2f, 4, 0.7f, 4), 0.5, 1e-6);
  EXPECT_NEAR(noise_texture(0.2f, 3, 0.7f, 3), 0, 1e-6);
  EXPECT_LE(std::abs(noise_texture(0.2f, 0, 0.7f, 0)), 1);
}

TEST(Pattern, ScatterSpreadsOverTheUnitInterval) {
  double sum = 0, squares = 0;
  for (int a = -50; a < 50; a++)
    for (int b = -50; b < 50; b++) {
      const double v = hash_unit(a, b);
      ASSERT_TRUE(v >= 0 && v <= 1);
      sum += v;
      squares += v * v;
    }
  EXPECT_NEAR(sum / 1e4, 0.5, 0.02);
  EXPECT_NEAR(squares / 1e4, 1.0 / 3, 0.02);
}

// Albedo over a footprint of `width` along the axes u and v: filtered, and averaged over sampled points.
struct Averages {
  V3 filtered, sampled;
};
Averages averages(const Objects& o, Kind kind, uint32_t index, const V3& p, const V3& normal, const V3& u, const V3& v,
                  float width) {
  constexpr int kSide = 24;
  Averages a{texture(o, kind, index, {p, normal, width * u, width * v}).albedo, V3(0)};
  for (int i = 0; i < kSide; i++)
    for (int j = 0; j < kSide; j++) {
      const float x = width * ((i + 0.5f) / kSide - 0.5f), y = width * ((j + 0.5f) / kSide - 0.5f);
      a.sampled += texture(o, kind, index, {p + x * u + y * v, normal, V3(0), V3(0)}).albedo;
    }
  a.sampled /= static_cast<float>(kSide * kSide);
  return a;
}

// Root mean square differences from the averaged albedo at random points: of filtered and of unfiltered albedo.
struct Errors {
  double filtered, raw;
};
Errors errors(const Objects& o, Kind kind, uint32_t index, const V3& centre, const V3& u, const V3& v, float half,
              float width) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> unit(-half, half);
  const V3 normal = glm::cross(u, v);
  double filtered = 0, raw = 0;
  constexpr int kPoints = 300;
  for (int i = 0; i < kPoints; i++) {
    const V3 p = centre + unit(random) * u + unit(random) * v;
    const Averages a = averages(o, kind, index, p, normal, u, v, width);
    const V3 point = texture(o, kind, index, {p, normal, V3(0), V3(0)}).albedo;
    filtered += glm::dot(a.filtered - a.sampled, a.filtered - a.sampled) / (3 * kPoints);
    raw += glm::dot(point - a.sampled, point - a.sampled) / (3 * kPoints);
  }
  return {std::sqrt(filtered), std::sqrt(raw)};
}

TEST(Texture, TexturesAreFilteredOverThePixel) {
  const Objects o = objects_at(0);
  // A pixel of a 320x240 camera covers about 1/400 of the distance.
  const Errors floor = errors(o, Kind::kRoom, 3, {0, kFloor, 3}, {1, 0, 0}, {0, 0, 1}, 1.0f, 0.03f);
  EXPECT_LT(floor.filtered, 0.01);
  EXPECT_LT(floor.filtered, 0.4 * floor.raw);
  const Errors wall = errors(o, Kind::kRoom, 5, {0, -0.3f, 5}, {1, 0, 0}, {0, 1, 0}, 1.2f, 0.0125f);
  EXPECT_LT(wall.filtered, 0.012);
  EXPECT_LT(wall.filtered, 0.6 * wall.raw);
  ASSERT_EQ(o.boxes[0].texture, Texture::kChart);
  const Errors chart =
      errors(o, Kind::kBox, 0, o.boxes[0].centre - V3(0, 0, 0.012f), {1, 0, 0}, {0, 1, 0}, 0.34f, 0.011f);
  EXPECT_LT(chart.filtered, 0.04);
  EXPECT_LT(chart.filtered, 0.4 * chart.raw);
}

TEST(Texture, AlbedosAreRealistic) {
  const Objects o = objects_at(0.4);
  std::mt19937 random(9);
  std::uniform_real_distribution<float> unit(-1, 1);
  const auto expect_real = [](const Material& f, const char* what) {
    for (int c = 0; c < 3; c++) EXPECT_TRUE(f.albedo[c] > 0 && f.albedo[c] < 1.2f) << what << " " << f.albedo[c];
    EXPECT_TRUE(f.gloss >= 0 && f.gloss <= 1);
  };
  for (int i = 0; i < 200; i++) {
    const V3 n = glm::normalize(V3(unit(random), unit(random), unit(random) - 1));
    for (uint32_t k = 0; k < o.spheres.size(); k++)
      expect_real(
          texture(o, Kind::kSphere, k, {o.spheres[k].centre + o.spheres[k].radius * n, n, V3(0.002f), V3(0.002f)}),
          "sphere");
    for (uint32_t k = 0; k < o.capsules.size(); k++)
      expect_real(texture(o, Kind::kCapsule, k, {o.capsules[k].base + o.capsules[k].radius * n, n, V3(0.002f), V3(0)}),
                  "capsule");
    for (uint32_t k = 0; k < o.boxes.size(); k++)
      expect_real(texture(o, Kind::kBox, k, {o.boxes[k].centre + o.boxes[k].half * n, {0, 0, -1}, V3(0), V3(0.002f)}),
                  "block");
    const V3 side = glm::normalize(V3(n.x, 0, n.z));
    for (uint32_t k = 0; k < o.cylinders.size(); k++) {
      const Cylinder& p = o.cylinders[k];
      expect_real(texture(o, Kind::kCylinder, k, {V3(p.x, p.top + 0.1f, p.z) + p.radius * side, side, V3(0), V3(0)}),
                  "pillar");
    }
    for (uint32_t face = 0; face < 6; face++)
      expect_real(texture(o, Kind::kRoom, face, {2.0f * n, {0, -1, 0}, V3(0.01f), V3(0.01f)}), "room");
  }
}

}  // namespace
}  // namespace lf::scene
