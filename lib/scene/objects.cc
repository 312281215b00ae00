// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/objects.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

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

// A wooden mannequin about 1 m tall that walks along an ellipse with a balloon in its left hand. The feet rest on the
// floor while they carry; knees and elbows follow from hip and foot, shoulder and hand.

namespace {

constexpr double kStepCycles = 3;  // pairs of steps per round
constexpr float kThigh = 0.26f, kShin = 0.25f, kUpperArm = 0.16f, kForearm = 0.15f;

// The figure's own axes on the floor: forward, to its right, height.
struct Frame {
  V3 origin, forward, right;
  V3 operator()(float f, float r, float height) const { return origin + f * forward + r * right - V3(0, height, 0); }
};

// Where the middle joint of a chain of two bones lies, bent towards `bend`.
V3 middle_joint(const V3& from, const V3& to, float first, float second, const V3& bend) {
  const V3 line = to - from;
  const float d = std::min(glm::length(line), first + second);
  const V3 u = glm::normalize(line);
  const float along = (first * first - second * second + d * d) / (2 * d);
  const float off = std::sqrt(std::max(0.0f, first * first - along * along));
  return from + along * u + off * glm::normalize(bend - glm::dot(bend, u) * u);
}

// Foot relative to the hip: along the way and above the floor, for half a step length `reach`. It carries for half of
// the cycle, moving back as fast as the body moves on, and swings forward in the other.
void foot_path(double cycle, float reach, float& f, float& height) {
  const double p = cycle - std::floor(cycle);
  if (p < 0.5) {
    f = reach * static_cast<float>(1 - 4 * p);
    height = 0;
  } else {
    const double q = 2 * p - 1, s = q * q * (3 - 2 * q);
    f = reach * static_cast<float>(2 * s - 1);
    height = 0.06f * static_cast<float>(std::sin(M_PI * q));
  }
}

void limb(Objects& o, const V3& a, const V3& b, float radius) {
  o.capsules.push_back({a, b - a, radius, Paint::kWood});
}

void ball(Objects& o, const V3& c, float radius, Paint paint = Paint::kJoint) {
  o.spheres.push_back({c, radius, paint});
}

void add_leg(Objects& o, const Frame& at, double cycle, float side, float hip_height, float reach) {
  float f, height;
  foot_path(cycle, reach, f, height);
  const V3 hip = at(0, side * 0.06f, hip_height), ankle = at(f, side * 0.06f, 0.05f + height);
  const V3 knee = middle_joint(hip, ankle, kThigh, kShin, at.forward);
  limb(o, hip, knee, 0.042f);
  limb(o, knee, ankle, 0.034f);
  limb(o, ankle + 0.018f * V3(0, 1, 0), at(f + 0.09f, side * 0.068f, 0.03f + 0.6f * height), 0.028f);
  ball(o, hip, 0.048f);
  ball(o, knee, 0.043f);
  ball(o, ankle, 0.036f);
}

V3 add_arm(Objects& o, const V3& shoulder, const V3& hand, const V3& bend) {
  const V3 elbow = middle_joint(shoulder, hand, kUpperArm, kForearm, bend);
  limb(o, shoulder, elbow, 0.030f);
  limb(o, elbow, hand, 0.026f);
  ball(o, shoulder, 0.042f);
  ball(o, elbow, 0.032f);
  ball(o, hand, 0.036f);
  return hand;
}

}  // namespace

void add_figure(double time, Objects& o) {
  const double round = time / kScenePeriod, angle = kTurn * round;
  const double rx = 0.24, rz = 0.13;
  const V3 velocity(-rx * std::sin(angle), 0, rz * std::cos(angle));  // per radian
  const float speed = glm::length(velocity) * static_cast<float>(kTurn / kScenePeriod);
  Frame at;
  at.origin = V3(0.02 + rx * std::cos(angle), kFloor, kSceneMiddle + 0.05 + rz * std::sin(angle));
  at.forward = glm::normalize(velocity);
  at.right = V3(at.forward.z, 0, -at.forward.x);
  const double cycle = kStepCycles * round;
  const float sway = static_cast<float>(std::sin(kTurn * cycle)), bob = static_cast<float>(std::cos(2 * kTurn * cycle));
  const float hip = 0.505f - 0.008f * bob;
  const float reach = speed * static_cast<float>(0.25 * kScenePeriod / kStepCycles);

  size_t spheres = o.spheres.size(), capsules = o.capsules.size();
  add_leg(o, at, cycle, -1, hip, reach);
  add_leg(o, at, cycle + 0.5, 1, hip, reach);
  o.add_group(spheres, capsules);

  spheres = o.spheres.size(), capsules = o.capsules.size();
  const float lean = 0.012f * sway;
  o.capsules.push_back({at(0, -0.04f, hip + 0.02f), 0.08f * at.right, 0.07f, Paint::kWood});
  ball(o, at(0, 0.5f * lean, hip + 0.105f), 0.058f);
  o.capsules.push_back({at(0, lean - 0.045f, hip + 0.215f), 0.09f * at.right, 0.085f, Paint::kWood});
  limb(o, at(0, lean, hip + 0.28f), at(0.01f, lean, hip + 0.36f), 0.030f);
  const V3 head = at(0.015f, lean, hip + 0.405f);
  o.capsules.push_back({head - V3(0, 0.035f, 0), V3(0, 0.045f, 0), 0.062f, Paint::kWood});
  for (const float side : {-1.0f, 1.0f})
    ball(o, head + 0.056f * at.forward + side * 0.024f * at.right - V3(0, 0.03f, 0), 0.011f, Paint::kEye);
  ball(o, head + 0.063f * at.forward, 0.013f);
  const V3 swinging = at(-0.10f * sway + 0.04f, 0.17f + lean, hip + 0.02f);
  add_arm(o, at(0, 0.13f + lean, hip + 0.265f), swinging, -at.forward);
  const V3 holding = at(0.13f, -0.19f + lean, hip + 0.30f + 0.01f * bob);
  add_arm(o, at(0, -0.13f + lean, hip + 0.265f), holding, V3(0, 1, 0) - 0.6f * at.right);
  o.add_group(spheres, capsules);

  spheres = o.spheres.size(), capsules = o.capsules.size();
  const double swing = 2 * angle;
  const V3 balloon = holding - V3(0, 0.25f, 0) + 0.03f * V3(std::sin(swing), 0, std::cos(swing)) - 0.03f * at.forward;
  ball(o, balloon, 0.085f, Paint::kBalloon);
  o.capsules.push_back({holding, balloon + V3(0, 0.085f, 0) - holding, 0.004f, Paint::kString});
  o.add_group(spheres, capsules);
}

}  // namespace lf::scene
