// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/objects.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>

#include "scene/scene.h"

namespace lf::scene {
namespace {

constexpr double kTurn = 2 * M_PI;
constexpr float kNear = kSceneNear, kMiddle = kSceneMiddle, kFar = kSceneFar;

glm::mat3 turned_about_y(double angle) {
  const float c = static_cast<float>(std::cos(angle)), s = static_cast<float>(std::sin(angle));
  return glm::mat3(c, 0, s, 0, 1, 0, -s, 0, c);
}

glm::mat3 turned_about_z(double angle) {
  const float c = static_cast<float>(std::cos(angle)), s = static_cast<float>(std::sin(angle));
  return glm::mat3(c, s, 0, -s, c, 0, 0, 0, 1);
}

Block block(const V3& centre, const V3& half, double degrees, Paint paint) {
  const double a = degrees * M_PI / 180;
  return {centre, half, glm::length(half), static_cast<float>(std::cos(a)), static_cast<float>(std::sin(a)), paint};
}

void add_globe(double time, Objects& o) {
  const size_t spheres = o.spheres.size(), capsules = o.capsules.size();
  const V3 centre(-0.26f, 0.15f, kNear);
  o.spheres.push_back({centre, 0.080f, Paint::kGlobe, turned_about_y(kTurn * time / kScenePeriod)});
  o.capsules.push_back({centre + V3(0, 0.07f, 0), V3(0, 0.06f, 0), 0.014f, Paint::kEasel});
  o.add_group(spheres, capsules);
  o.pillars.push_back({centre.x, centre.z, 0.078f, 0.265f, kFloor, Paint::kPlinth});
}

// Hangs from the ceiling above (x, z) and swings twice per period.
void add_pendulum(double time, float x, float z, float length, double phase, Objects& o) {
  const size_t spheres = o.spheres.size(), capsules = o.capsules.size();
  const double a = 0.055 * std::sin(kTurn * (2 * time / kScenePeriod + phase));
  const V3 top(x, kRoomMin.y, z), down(std::sin(a), std::cos(a), 0.3 * std::sin(a));
  o.spheres.push_back({top + length * down, 0.046f, Paint::kSwirl, turned_about_y(8 * a + phase)});
  o.capsules.push_back({top, (length - 0.044f) * down, 0.003f, Paint::kString});
  o.add_group(spheres, capsules);
}

void add_beach_ball(double time, Objects& o) {
  const size_t spheres = o.spheres.size(), capsules = o.capsules.size();
  const double x = 0.10 * std::sin(kTurn * time / kScenePeriod), radius = 0.125;
  o.spheres.push_back({V3(-0.60 + x, kFloor - radius, kMiddle), static_cast<float>(radius), Paint::kBeachBall,
                       turned_about_z(-x / radius)});  // rolls without slipping
  o.add_group(spheres, capsules);
}

void add_plant(double time, Objects& o) {
  const size_t spheres = o.spheres.size(), capsules = o.capsules.size();
  const V3 pot(-0.62f, 0.3f, kFar);
  const float nod = 0.012f * static_cast<float>(std::sin(kTurn * time / kScenePeriod));
  constexpr float kLeaves[][4] = {{0, -0.12f, -0.04f, 0.15f},      {-0.14f, -0.20f, 0.02f, 0.13f},
                                  {0.13f, -0.24f, 0.03f, 0.14f},   {-0.02f, -0.36f, 0.02f, 0.15f},
                                  {-0.13f, -0.42f, -0.03f, 0.10f}, {0.10f, -0.46f, 0, 0.11f},
                                  {0.01f, -0.58f, 0, 0.09f}};
  for (const auto& [x, y, z, r] : kLeaves)
    o.spheres.push_back({pot + V3(x - nod * y * 4, y, z), r, Paint::kLeaves, turned_about_y(7 * x)});
  o.add_group(spheres, capsules);
  o.pillars.push_back({pot.x, pot.z, 0.13f, pot.y, kFloor, Paint::kPot});
}

void add_easel(Objects& o) {
  const size_t spheres = o.spheres.size(), capsules = o.capsules.size();
  for (const float side : {-1.0f, 1.0f}) {
    const V3 foot(0.55f + side * 0.42f, kFloor, kFar + 0.05f), head(0.55f + side * 0.2f, -0.5f, kFar + 0.05f);
    o.capsules.push_back({head, foot - head, 0.022f, Paint::kEasel});
  }
  o.add_group(spheres, capsules);
  o.blocks.push_back(block({0.55f, -0.08f, kFar}, {0.46f, 0.345f, 0.012f}, 0, Paint::kChart));
}

void add_blocks(double time, Objects& o) {
  o.pillars.push_back({0.27f, kNear + 0.02f, 0.13f, 0.27f, kFloor, Paint::kTable});
  o.blocks.push_back(block({0.28f, 0.21f, kNear + 0.02f}, {0.06f, 0.06f, 0.06f}, 24, Paint::kChequers));
  const double turn = 360 * time / kScenePeriod;
  o.blocks.push_back(block({0.28f, 0.105f, kNear + 0.02f}, {0.045f, 0.045f, 0.045f}, -15 + turn / 4, Paint::kRings));
  o.blocks.push_back(block({0.64f, 0.43f, kMiddle + 0.08f}, {0.17f, 0.17f, 0.17f}, 28, Paint::kCrate));
}

void add_columns(Objects& o) {
  for (const float x : {-1.30f, 1.42f}) o.pillars.push_back({x, kFar, 0.15f, kRoomMin.y, kFloor, Paint::kColumn});
}

}  // namespace

void Objects::add_group(size_t first_sphere, size_t first_capsule) {
  V3 low(std::numeric_limits<float>::infinity()), high(-std::numeric_limits<float>::infinity());
  const auto grow = [&](const V3& p, float r) {
    low = glm::min(low, p - V3(r));
    high = glm::max(high, p + V3(r));
  };
  const auto each = [&](auto&& visit) {
    for (size_t i = first_sphere; i < spheres.size(); i++) visit(spheres[i].centre, spheres[i].radius);
    for (size_t i = first_capsule; i < capsules.size(); i++) {
      visit(capsules[i].base, capsules[i].radius);
      visit(capsules[i].base + capsules[i].axis, capsules[i].radius);
    }
  };
  each(grow);
  const V3 centre = 0.5f * (low + high);
  float radius = 0;
  each([&](const V3& p, float r) { radius = std::max(radius, glm::length(p - centre) + r); });
  groups.push_back({centre, radius * 1.0001f, static_cast<uint32_t>(first_sphere),
                    static_cast<uint32_t>(spheres.size()), static_cast<uint32_t>(first_capsule),
                    static_cast<uint32_t>(capsules.size())});
}

Objects objects_at(double time) {
  Objects o;
  add_globe(time, o);
  add_pendulum(time, 0.12f, kNear + 0.05f, 1.50f, 0, o);
  add_pendulum(time, 0.33f, kNear + 0.30f, 1.56f, 0.3, o);
  add_beach_ball(time, o);
  add_figure(time, o);
  add_plant(time, o);
  add_easel(o);
  add_blocks(time, o);
  add_columns(o);
  return o;
}

}  // namespace lf::scene
