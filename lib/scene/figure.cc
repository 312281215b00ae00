// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "scene/objects.h"
#include "scene/scene.h"

// A wooden mannequin about 1 m tall that walks along an ellipse with a balloon in its left hand. The feet rest on the
// floor while they carry; knees and elbows follow from hip and foot, shoulder and hand.
namespace lf::scene {
namespace {

constexpr double kTurn = 2 * M_PI;
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
