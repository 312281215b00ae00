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

Box block(const V3& centre, const V3& half, double degrees, Texture texture) {
  const double a = degrees * M_PI / 180;
  return {centre, half, glm::length(half), static_cast<float>(std::cos(a)), static_cast<float>(std::sin(a)), texture};
}

void add_globe(double time, Objects& o) {
  const size_t spheres = o.spheres.size(), capsules = o.capsules.size();
  const V3 centre(-0.26f, 0.15f, kNear);
  o.spheres.push_back({centre, 0.080f, Texture::kGlobe, turned_about_y(kTurn * time / kScenePeriod)});
  o.capsules.push_back({centre + V3(0, 0.07f, 0), V3(0, 0.06f, 0), 0.014f, Texture::kEasel});
  o.add_group(spheres, capsules);
  o.cylinders.push_back({centre.x, centre.z, 0.078f, 0.265f, kFloor, Texture::kPlinth});
}

// The string hangs from the ceiling above (x, z), and swings twice per period.
void add_pendulum(double time, float x, float z, float length, double phase, Objects& o) {
  const size_t spheres = o.spheres.size(), capsules = o.capsules.size();
  const double a = 0.055 * std::sin(kTurn * (2 * time / kScenePeriod + phase));
  const V3 top(x, kRoomMin.y, z), down(std::sin(a), std::cos(a), 0.3 * std::sin(a));
  o.spheres.push_back({top + length * down, 0.046f, Texture::kSwirl, turned_about_y(8 * a + phase)});
  o.capsules.push_back({top, (length - 0.044f) * down, 0.003f, Texture::kString});
  o.add_group(spheres, capsules);
}

void add_beach_ball(double time, Objects& o) {
  const size_t spheres = o.spheres.size(), capsules = o.capsules.size();
  const double x = 0.10 * std::sin(kTurn * time / kScenePeriod), radius = 0.125;
  o.spheres.push_back({V3(-0.60 + x, kFloor - radius, kMiddle), static_cast<float>(radius), Texture::kBeachBall,
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
    o.spheres.push_back({pot + V3(x - nod * y * 4, y, z), r, Texture::kLeaves, turned_about_y(7 * x)});
  o.add_group(spheres, capsules);
  o.cylinders.push_back({pot.x, pot.z, 0.13f, pot.y, kFloor, Texture::kPot});
}

void add_easel(Objects& o) {
  const size_t spheres = o.spheres.size(), capsules = o.capsules.size();
  for (const float side : {-1.0f, 1.0f}) {
    const V3 foot(0.55f + side * 0.42f, kFloor, kFar + 0.05f), head(0.55f + side * 0.2f, -0.5f, kFar + 0.05f);
    o.capsules.push_back({head, foot - head, 0.022f, Texture::kEasel});
  }
  o.add_group(spheres, capsules);
  o.boxes.push_back(block({0.55f, -0.08f, kFar}, {0.46f, 0.345f, 0.012f}, 0, Texture::kChart));
}

void add_blocks(double time, Objects& o) {
  o.cylinders.push_back({0.27f, kNear + 0.02f, 0.13f, 0.27f, kFloor, Texture::kTable});
  o.boxes.push_back(block({0.28f, 0.21f, kNear + 0.02f}, {0.06f, 0.06f, 0.06f}, 24, Texture::kChequers));
  const double turn = 360 * time / kScenePeriod;
  o.boxes.push_back(block({0.28f, 0.105f, kNear + 0.02f}, {0.045f, 0.045f, 0.045f}, -15 + turn / 4, Texture::kRings));
  o.boxes.push_back(block({0.64f, 0.43f, kMiddle + 0.08f}, {0.17f, 0.17f, 0.17f}, 28, Texture::kCrate));
}

void add_columns(Objects& o) {
  for (const float x : {-1.30f, 1.42f}) o.cylinders.push_back({x, kFar, 0.15f, kRoomMin.y, kFloor, Texture::kColumn});
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

// A wooden mannequin about 1 m tall, which walks along an ellipse with a balloon in its left hand. Feet do not move on
// the floor while they carry weight. The positions of knees and elbows follow from hip and foot, shoulder and hand.

namespace {

constexpr double kStepCycles = 3;  // pairs of steps per round
constexpr float kThigh = 0.26f, kShin = 0.25f, kUpperArm = 0.16f, kForearm = 0.15f;

// The figure's coordinate axes on the floor: forward, right, height.
struct Frame {
  V3 origin, forward, right;
  V3 operator()(float f, float r, float height) const { return origin + f * forward + r * right - V3(0, height, 0); }
};

// Returns the middle joint of a chain of two bones, bent towards `bend`.
V3 middle_joint(const V3& from, const V3& to, float first, float second, const V3& bend) {
  const V3 line = to - from;
  const float d = std::min(glm::length(line), first + second);
  const V3 u = glm::normalize(line);
  const float along = (first * first - second * second + d * d) / (2 * d);
  const float off = std::sqrt(std::max(0.0f, first * first - along * along));
  return from + along * u + off * glm::normalize(bend - glm::dot(bend, u) * u);
}

// Computes the foot relative to the hip, along the way (`f`) and above the floor, for half a step length `reach`. For
// half of the cycle, the foot carries weight and moves back as fast as the body moves forward. Then it swings forward.
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
  o.capsules.push_back({a, b - a, radius, Texture::kWood});
}

void ball(Objects& o, const V3& c, float radius, Texture texture = Texture::kJoint) {
  o.spheres.push_back({c, radius, texture});
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
  o.capsules.push_back({at(0, -0.04f, hip + 0.02f), 0.08f * at.right, 0.07f, Texture::kWood});
  ball(o, at(0, 0.5f * lean, hip + 0.105f), 0.058f);
  o.capsules.push_back({at(0, lean - 0.045f, hip + 0.215f), 0.09f * at.right, 0.085f, Texture::kWood});
  limb(o, at(0, lean, hip + 0.28f), at(0.01f, lean, hip + 0.36f), 0.030f);
  const V3 head = at(0.015f, lean, hip + 0.405f);
  o.capsules.push_back({head - V3(0, 0.035f, 0), V3(0, 0.045f, 0), 0.062f, Texture::kWood});
  for (const float side : {-1.0f, 1.0f})
    ball(o, head + 0.056f * at.forward + side * 0.024f * at.right - V3(0, 0.03f, 0), 0.011f, Texture::kEye);
  ball(o, head + 0.063f * at.forward, 0.013f);
  const V3 swinging = at(-0.10f * sway + 0.04f, 0.17f + lean, hip + 0.02f);
  add_arm(o, at(0, 0.13f + lean, hip + 0.265f), swinging, -at.forward);
  const V3 holding = at(0.13f, -0.19f + lean, hip + 0.30f + 0.01f * bob);
  add_arm(o, at(0, -0.13f + lean, hip + 0.265f), holding, V3(0, 1, 0) - 0.6f * at.right);
  o.add_group(spheres, capsules);

  spheres = o.spheres.size(), capsules = o.capsules.size();
  const double swing = 2 * angle;
  const V3 balloon = holding - V3(0, 0.25f, 0) + 0.03f * V3(std::sin(swing), 0, std::cos(swing)) - 0.03f * at.forward;
  ball(o, balloon, 0.085f, Texture::kBalloon);
  o.capsules.push_back({holding, balloon + V3(0, 0.085f, 0) - holding, 0.004f, Texture::kString});
  o.add_group(spheres, capsules);
}

namespace {

// Converts gamma-encoded 0..255 to linear light, with the camera's gamma of 2.
constexpr V3 linear(int r, int g, int b) {
  return {(r / 255.0f) * (r / 255.0f), (g / 255.0f) * (g / 255.0f), (b / 255.0f) * (b / 255.0f)};
}

V3 mix(const V3& a, const V3& b, float t) { return a + t * (b - a); }

struct Texel {
  float u, v, wu, wv;
  Texel scaled(float su, float sv) const { return {u * su, v * sv, wu * su, wv * sv}; }
};

Texel project(const Surface& s, const V3& u_axis, const V3& v_axis, const V3& origin) {
  const V3 p = s.point - origin;
  return {glm::dot(p, u_axis), glm::dot(p, v_axis), std::abs(glm::dot(s.dx, u_axis)) + std::abs(glm::dot(s.dy, u_axis)),
          std::abs(glm::dot(s.dx, v_axis)) + std::abs(glm::dot(s.dy, v_axis))};
}

float footprint(const Surface& s) { return std::sqrt(std::max(glm::dot(s.dx, s.dx), glm::dot(s.dy, s.dy))); }

float grain_of(const Texel& t) { return noise_texture(t.u, t.wu, t.v, t.wv); }

// Returns 1 inside of low..high, averaged over the width.
float inside(float x, float w, float low, float high) {
  w = std::max(w, 1e-5f);
  return std::clamp((std::min(x + w / 2, high) - std::max(x - w / 2, low)) / w, 0.0f, 1.0f);
}

float inside(const Texel& t, float u0, float u1, float v0, float v1) {
  return inside(t.u, t.wu, u0, u1) * inside(t.v, t.wv, v0, v1);
}

Material floor_paint(const Surface& s) {
  const Texel t = project(s, {1, 0, 0}, {0, 0, 1}, {0.11f, 0, 0});
  const Texel tile = t.scaled(1 / 0.3f, 1 / 0.3f);
  V3 c = mix(linear(196, 150, 108), linear(224, 192, 150), checker(tile.u, tile.wu, tile.v, tile.wv));
  c *= 1 + 0.10f * grain_of(t.scaled(3, 16));
  return {c, 0.05f};
}

V3 bricks(const Texel& t) {
  const Texel b = t.scaled(1 / 0.34f, 1 / 0.13f);
  const float row = floor_of(b.v);
  const float u = b.u + 0.5f * (row - 2 * floor_of(row / 2));
  const float joint_u = stripes(u + 0.02f, b.wu, 0.04f), joint_v = stripes(b.v + 0.06f, b.wv, 0.12f);
  const float joint = joint_u + joint_v - joint_u * joint_v;
  const float tint = hash_unit(static_cast<int>(floor_of(u)), static_cast<int>(row)) - 0.5f;
  const float sharp = 1 - ramp(0.3f, 1.0f, std::max(b.wu, b.wv));
  V3 c = linear(122, 150, 156) * (1 + 0.22f * tint * sharp) * (1 + 0.08f * grain_of(t.scaled(7, 9)));
  return mix(c, linear(148, 168, 170), joint);
}

// Paints a landscape: hills before an evening sky. u and v are 0..1 inside the frame.
V3 picture(const Texel& t) {
  V3 c = mix(linear(88, 120, 178), linear(250, 188, 120), ramp(0.05f, 0.7f, t.v));
  const float dx = (t.u - 0.68f) * 1.35f, dy = t.v - 0.42f, r = std::sqrt(dx * dx + dy * dy), w = std::max(t.wv, 1e-4f);
  c = mix(c, linear(255, 240, 190), inside(r, w, -1, 0.10f));
  const float far_hill = 0.58f + 0.05f * cos_turns(1.3f * t.u + 0.1f) + 0.02f * cos_turns(4.1f * t.u);
  c = mix(c, linear(116, 98, 140), inside(t.v, w, far_hill, 2));
  const float near_hill = 0.76f + 0.08f * cos_turns(0.9f * t.u + 0.55f) + 0.012f * cos_turns(6.3f * t.u);
  const V3 meadow = linear(70, 96, 62) * (1 + 0.5f * grain_of(t.scaled(9, 7)));
  return mix(c, meadow, inside(t.v, w, near_hill, 2));
}

Material wall_paint(const Surface& s) {
  const Texel t = project(s, {1, 0, 0}, {0, 1, 0}, {0, 0, 0});
  V3 c = bricks(t);
  const float panel = stripes(t.u / 0.4f + 0.06f, t.wu / 0.4f, 0.12f);
  const V3 skirting = mix(linear(206, 198, 182), linear(168, 160, 146), panel);
  c = mix(c, skirting, inside(t.v, t.wv, 0.28f, 2));
  c = mix(c, linear(230, 224, 210), inside(t.v, t.wv, 0.25f, 0.29f));
  const Texel f{t.u + 1.02f, t.v + 1.05f, t.wu, t.wv};
  c = mix(c, linear(132, 100, 66), inside(f, -0.05f, 0.99f, -0.05f, 0.75f));
  c = mix(c, linear(196, 190, 172), inside(f, 0, 0.94f, 0, 0.70f));
  const float opening = inside(f, 0.05f, 0.89f, 0.05f, 0.65f);
  if (opening > 0)
    c = mix(c, picture(Texel{f.u - 0.05f, f.v - 0.05f, f.wu, f.wv}.scaled(1 / 0.84f, 1 / 0.6f)), opening);
  return {c, 0};
}

Material plaster(const Surface& s, uint32_t face) {
  const bool sideways = face < 2;
  const Texel t = project(s, sideways ? V3(0, 0, 1) : V3(1, 0, 0), face == 2 ? V3(0, 0, 1) : V3(0, 1, 0), {0, 0, 0});
  const V3 c = face == 2 ? linear(226, 222, 212) : linear(198, 186, 164);
  return {c * (1 + 0.10f * grain_of(t.scaled(3, 3))), 0};
}

// Computes cosine and sine of 2^doublings times the angle, by repeated squaring of x + iy on the unit circle.
void multiply_angle(float& x, float& y, int doublings) {
  for (int i = 0; i < doublings; i++) {
    const float c = x * x - y * y;
    y = 2 * x * y;
    x = c;
  }
}

Material chart_paint(const Texel& t) {
  const V3 paper = linear(208, 204, 190), ink = linear(92, 96, 104), red = linear(190, 88, 76),
           blue = linear(82, 116, 168);
  V3 c = paper;
  const float margin = 1 - inside(t, -0.435f, 0.435f, -0.32f, 0.32f);
  const Texel field = t.scaled(1 / 0.055f, 1 / 0.055f);
  c = mix(c, ink, checker(field.u, field.wu, field.v, field.wv) * inside(t, -0.385f, -0.055f, -0.275f, -0.055f));
  const float w = std::max(std::max(t.wu, t.wv), 1e-5f);
  {
    float x = t.u - 0.2f, y = t.v + 0.15f;
    const float r = std::max(std::sqrt(x * x + y * y), 1e-6f);
    x /= r, y /= r;
    multiply_angle(x, y, 3);
    // The wave's slope across an edge is 8 / r. Its average over w saturates beyond that.
    const float edge = std::clamp(0.5f + x * r / (8 * w), 0.0f, 1.0f);
    const float fade = ramp(0.5f, 1.5f, r / (8 * w) * 3);
    c = mix(c, blue, inside(r, w, -1, 0.13f) * (0.5f + (edge - 0.5f) * fade));
  }
  for (int i = 0; i < 3; i++) {
    const float pitch = 0.018f * static_cast<float>(1 << i), top = 0.02f + 0.09f * static_cast<float>(i);
    c = mix(c, ink, stripes(t.u / pitch, t.wu / pitch, 0.5f) * inside(t, -0.385f, 0.01f, top, top + 0.07f));
  }
  const float dx = t.u - 0.2f, dy = t.v - 0.15f, r = std::sqrt(dx * dx + dy * dy);
  c = mix(c, red, stripes(r / 0.065f, w / 0.065f, 0.5f) * inside(r, w, -1, 0.13f));
  return {mix(c, linear(96, 70, 48), margin), 0.02f};
}

Material crate_paint(const Texel& t, float half) {
  const Texel plank = t.scaled(1 / 0.068f, 1 / 0.068f);
  V3 c = linear(186, 140, 88) * (1 + 0.22f * grain_of(t.scaled(6, 60)));
  c = mix(c, linear(92, 62, 38), stripes(plank.u + 0.05f, plank.wu, 0.1f));
  const float inner = half - 0.03f, frame = 1 - inside(t, -inner, inner, -inner, inner);
  return {mix(c, linear(150, 104, 60) * (1 + 0.15f * grain_of(t.scaled(40, 40))), frame), 0.03f};
}

Material block_paint(const Box& b, const Surface& s) {
  const V3 x_axis(b.cosine, 0, b.sine), z_axis(-b.sine, 0, b.cosine);
  const float nx = std::abs(glm::dot(s.normal, x_axis)), ny = std::abs(s.normal.y);
  const Texel t = project(s, nx > 0.5f ? z_axis : x_axis, ny > 0.5f ? z_axis : V3(0, 1, 0), b.centre);
  switch (b.texture) {
    case Texture::kChart: return ny > 0.5f || nx > 0.5f ? Material{linear(96, 70, 48)} : chart_paint(t);
    case Texture::kCrate: return crate_paint(t, b.half.x);
    case Texture::kRings: {
      const float r = std::sqrt(t.u * t.u + t.v * t.v), w = std::max(t.wu, t.wv);
      return {mix(linear(206, 176, 98), linear(92, 138, 124), stripes(r / 0.022f, w / 0.022f, 0.5f)), 0.10f};
    }
    default: {
      const float edge = b.half.x - 0.009f, frame = 1 - inside(t, -edge, edge, -edge, edge);
      const Texel f = t.scaled(1 / 0.0255f, 1 / 0.0255f);
      const V3 fields = mix(linear(216, 206, 190), linear(176, 96, 80), checker(f.u, f.wu, f.v, f.wv));
      return {mix(fields, linear(178, 136, 88), frame), 0.10f};
    }
  }
}

V3 globe_colour(const V3& n, float w) {
  const float land = wave(0.6f * n.x + 0.5f * n.z + 0.2f, 0.6f * w) + 0.8f * wave(0.9f * n.z - 0.7f * n.y + 0.6f, w) +
                     0.5f * wave(1.9f * n.x + 1.2f * n.y, 2 * w) + 0.3f * wave(3.9f * n.z + 2.1f * n.x, 4 * w);
  const float detail = wave(7 * n.x + 3 * n.y, 7 * w) + wave(6 * n.z - 5 * n.y, 7 * w);
  const V3 ground = mix(linear(108, 148, 92), linear(182, 164, 108), 0.5f + 0.25f * detail);
  V3 c = mix(linear(66, 112, 160), ground, ramp(0.12f, 0.12f + std::max(0.12f, 6 * w), land));
  c = mix(c, linear(214, 220, 222), ramp(0.86f, 0.90f + 2 * w, std::abs(n.y)));
  const float r = std::sqrt(n.x * n.x + n.z * n.z);
  float x = n.x / std::max(r, 1e-6f), z = n.z / std::max(r, 1e-6f);
  multiply_angle(x, z, 3);
  const float lines = std::max(stripes(n.y / 0.25f + 0.05f, w / 0.25f, 0.1f),
                               ramp(0.9f, 0.98f, x) * ramp(0.3f, 0.5f, r) * filtered_amplitude(std::min(1.0f, 4 * w)));
  return mix(c, linear(226, 226, 214), 0.30f * lines);
}

Material sphere_paint(const Sphere& ball, const Surface& s) {
  const V3 n = ball.local_from_world * s.normal;
  const float w = footprint(s) / ball.radius;
  switch (ball.texture) {
    case Texture::kJoint: return {linear(150, 58, 44), 0.15f};
    case Texture::kEye: return {linear(24, 22, 24), 0.6f};
    case Texture::kBalloon: return {linear(206, 70, 70), 0.5f};
    case Texture::kGlobe: return {globe_colour(n, w), 0.25f};
    case Texture::kBeachBall: {
      // Six gores around z: sin 3a has the same sign as y (3 x^2 - y^2).
      const float wedge = n.y * (3 * n.x * n.x - n.y * n.y) / std::max(std::pow(n.x * n.x + n.y * n.y, 1.5f), 1e-6f);
      const float soft = 3 * w / std::max(std::sqrt(n.x * n.x + n.y * n.y), 0.05f) + 1e-4f;
      V3 c = mix(linear(224, 218, 206), linear(84, 134, 186), std::clamp(0.5f + wedge / soft, 0.0f, 1.0f));
      c = mix(c, linear(240, 190, 60), inside(std::abs(n.z), w, 0.90f, 2));
      return {c, 0.30f};
    }
    case Texture::kSwirl: {
      const float band = stripes(2.4f * n.y + 0.5f * n.x, 2.5f * w, 0.5f);
      return {mix(linear(136, 100, 160), linear(214, 184, 126), band), 0.45f};
    }
    case Texture::kLeaves: {
      const float leaf = wave(2.3f * n.x + 1.1f * n.y, 2.6f * w) * wave(1.2f * n.z - 2.6f * n.y, 2.9f * w) +
                         0.6f * wave(4.1f * n.y + 2.3f * n.x, 4.7f * w) * wave(3.9f * n.x - 2 * n.z, 4.4f * w);
      return {mix(linear(78, 112, 64), linear(118, 150, 82), 0.5f + 0.45f * leaf), 0.04f};
    }
    default: return {linear(200, 200, 200), 0};
  }
}

V3 wood(float along, float w) {
  return mix(linear(216, 172, 116), linear(192, 144, 92), 0.5f + 0.5f * wave(along / 0.035f, w / 0.035f));
}

Material capsule_paint(const Capsule& c, const Surface& s) {
  const float along = glm::dot(s.point - c.base, c.axis) / glm::length(c.axis);
  switch (c.texture) {
    case Texture::kWood: return {wood(along, footprint(s)), 0.12f};
    case Texture::kString: return {linear(70, 62, 58), 0};
    default: return {linear(122, 84, 52), 0.05f};
  }
}

Material pillar_paint(const Cylinder& p, const Surface& s) {
  const float w = footprint(s);
  float x = (s.point.x - p.x) / p.radius, z = (s.point.z - p.z) / p.radius;
  const Texel top = project(s, {1, 0, 0}, {0, 0, 1}, {p.x, 0, p.z});
  const bool on_top = s.normal.y < -0.5f;
  switch (p.texture) {
    case Texture::kColumn: {
      multiply_angle(x, z, 4);
      const float flute = x * filtered_amplitude(std::min(1.0f, 16 * w / (6.28f * p.radius)));
      return {
          linear(216, 208, 190) * (0.86f + 0.16f * flute) * (1 + 0.06f * grain_of({3 * z, 2 * s.point.y, w, 2 * w})),
          0.04f};
    }
    case Texture::kPot: return {linear(190, 104, 72) * (0.9f + 0.1f * wave(s.point.y / 0.07f, w / 0.07f)), 0.06f};
    case Texture::kTable:
      if (on_top) return {linear(206, 160, 104) * (1 + 0.15f * grain_of(top.scaled(12, 70))), 0.10f};
      return {mix(linear(206, 160, 104), linear(130, 90, 56), inside(s.point.y, w, p.top + 0.03f, 2)), 0.08f};
    default: {
      if (on_top) return {linear(204, 198, 188), 0.05f};
      const float veins = noise_texture(9 * x + 4 * s.point.y, 9 * w / p.radius, 14 * s.point.y + 3 * z, 14 * w);
      return {mix(linear(212, 206, 196), linear(172, 170, 168), ramp(0.1f, 0.6f, veins)), 0.08f};
    }
  }
}

}  // namespace

Material texture(const Objects& objects, Kind kind, uint32_t index, const Surface& surface) {
  switch (kind) {
    case Kind::kRoom:
      if (index == 3) return floor_paint(surface);
      return index == 5 ? wall_paint(surface) : plaster(surface, index);
    case Kind::kSphere: return sphere_paint(objects.spheres[index], surface);
    case Kind::kCapsule: return capsule_paint(objects.capsules[index], surface);
    case Kind::kCylinder: return pillar_paint(objects.cylinders[index], surface);
    case Kind::kBox: return block_paint(objects.boxes[index], surface);
    case Kind::kNothing: break;
  }
  return {};
}

}  // namespace lf::scene
