// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/trace.h"

#include "support/test.h"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace lf::scene {
namespace {

using D3 = glm::dvec3;

double segment_distance(const D3& p, const D3& a, const D3& axis) {
  const double u = std::clamp(glm::dot(p - a, axis) / glm::dot(axis, axis), 0.0, 1.0);
  return glm::length(p - a - u * axis);
}

double box_distance(const D3& q, const D3& half) {
  const D3 d = glm::abs(q) - half;
  return glm::length(glm::max(d, D3(0))) + std::min(std::max({d.x, d.y, d.z}), 0.0);
}

// Signed distance to the nearest surface of the scene: an independent implementation of the geometry, in double.
double distance(const Objects& o, const D3& p) {
  const D3 room_centre = 0.5 * (D3(kRoomMin) + D3(kRoomMax)), room_half = 0.5 * (D3(kRoomMax) - D3(kRoomMin));
  double d = -box_distance(p - room_centre, room_half);
  for (const Sphere& s : o.spheres) d = std::min(d, glm::length(p - D3(s.centre)) - s.radius);
  for (const Capsule& c : o.capsules) d = std::min(d, segment_distance(p, D3(c.base), D3(c.axis)) - c.radius);
  for (const Cylinder& c : o.cylinders) {
    const double r = std::hypot(p.x - c.x, p.z - c.z) - c.radius, y = std::max<double>(c.top - p.y, p.y - c.bottom);
    d = std::min(d, std::min(std::max(r, y), 0.0) + std::hypot(std::max(r, 0.0), std::max(y, 0.0)));
  }
  for (const Box& b : o.boxes) {
    const D3 v = p - D3(b.centre), q(b.cosine * v.x + b.sine * v.z, v.y, b.cosine * v.z - b.sine * v.x);
    d = std::min(d, box_distance(q, D3(b.half)));
  }
  return d;
}

TEST(Trace, HitsMatchTheDistanceField) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> unit(-1, 1);
  int objects_hit = 0;
  for (int i = 0; i < 3000; i++) {
    const Objects o = objects_at(0.37 * (i / 300));
    const D3 origin(0.3 * unit(random), 0.3 * unit(random), 0.2 * unit(random));
    D3 direction = glm::normalize(D3(0.7 * unit(random), 0.5 * unit(random), 1));
    if (i % 10 == 0) direction = glm::normalize(D3(unit(random), unit(random), unit(random)));
    double t = 0, gap = 1;
    for (int step = 0; step < 400 && gap > 1e-5; step++) t += gap = distance(o, origin + t * direction);
    const Hit hit = intersect_scene(o, {V3(origin), V3(direction)});
    ASSERT_NE(hit.kind, Kind::kNothing);
    EXPECT_NEAR(glm::length(hit.normal), 1, 1e-5);
    EXPECT_LE(glm::dot(D3(hit.normal), direction), 1e-3);
    EXPECT_LT(std::abs(distance(o, origin + static_cast<double>(hit.t) * direction)), 5e-5);
    EXPECT_GE(hit.t, t - 1e-4);
    // Ray marching stops early at grazing angles, where it bounds the hit from one side only.
    if (gap <= 1e-5 && glm::dot(D3(hit.normal), direction) < -0.1) {
      EXPECT_NEAR(hit.t, t, 1e-3) << "kind " << static_cast<int>(hit.kind);
    }
    objects_hit += hit.kind != Kind::kRoom;
  }
  EXPECT_GT(objects_hit, 500);
}

TEST(Trace, HitsEveryKindOfObject) {
  const Objects o = objects_at(0);
  const auto kind_towards = [&](const V3& target) { return intersect_scene(o, {V3(0), glm::normalize(target)}).kind; };
  EXPECT_EQ(kind_towards(o.spheres[0].centre), Kind::kSphere);
  EXPECT_EQ(kind_towards(V3(o.cylinders[0].x, o.cylinders[0].top + 0.05f, o.cylinders[0].z)), Kind::kCylinder);
  EXPECT_EQ(kind_towards(o.boxes[1].centre), Kind::kBox);
  EXPECT_EQ(kind_towards(o.capsules[1].base + 0.8f * o.capsules[1].axis), Kind::kCapsule);
  EXPECT_EQ(kind_towards({0, 0, -1}), Kind::kRoom);
}

TEST(Trace, RaysAlongTheAxesAreFinite) {
  const Objects o = objects_at(0);
  for (int axis = 0; axis < 3; axis++)
    for (const float sign : {-1.0f, 1.0f}) {
      V3 d(0);
      d[axis] = sign;
      const Hit hit = intersect_scene(o, {V3(0), d});
      EXPECT_TRUE(hit.kind != Kind::kNothing && hit.t > 0 && hit.t < 10) << axis << " " << sign;
      ShadowCache shadows;
      const V3 light = trace(o, {V3(0), d}, shadows).light;
      EXPECT_TRUE(light.x >= 0 && light.x < 4 && light.y >= 0 && light.z >= 0) << axis << " " << sign;
    }
}

TEST(Trace, OutsideTheRoomIsNothing) {
  EXPECT_EQ(intersect_scene(objects_at(0), {{0, -5, 0}, {0, -1, 0}}).kind, Kind::kNothing);
  EXPECT_EQ(intersect_scene(objects_at(0), {{0, -5, 0}, {0, 0, 1}}).kind, Kind::kNothing);
}

TEST(Trace, ShadowsHavePenumbras) {
  Objects o;
  o.spheres.push_back({{0, 0, 1}, 0.1f, Texture::kJoint});
  o.add_group(0, 0);
  const auto seen = [&](float x) { return light_visibility(o, {x, 0, 0}, {0, 0, 1}, 3, 0.05f, Kind::kRoom, 0); };
  EXPECT_EQ(seen(0), 0);
  EXPECT_NEAR(seen(0.1f), 0.5, 0.02);
  EXPECT_EQ(seen(0.2f), 1);
  EXPECT_GT(seen(0.12f), seen(0.09f));
  // A light nearer than the sphere is not in its shadow, and the sphere does not shadow itself.
  EXPECT_EQ(light_visibility(o, {0, 0, 0}, {0, 0, 1}, 0.5f, 0.05f, Kind::kRoom, 0), 1);
  EXPECT_EQ(light_visibility(o, {0, 0, 0.9f}, {0, 0, 1}, 3, 0.05f, Kind::kSphere, 0), 1);
}

TEST(Trace, SamplesOfAPixelShareShadows) {
  ShadowCache shadows;
  int found = 0;
  const auto find = [&] { return 0.25f * static_cast<float>(++found); };
  EXPECT_EQ(shadows.seen(0, 7, find), 0.25f);
  EXPECT_EQ(shadows.seen(0, 7, find), 0.25f);
  EXPECT_EQ(shadows.seen(1, 7, find), 0.5f);
  EXPECT_EQ(shadows.seen(0, 8, find), 0.75f);
  EXPECT_EQ(shadows.seen(1, 7, find), 0.5f);
  EXPECT_EQ(found, 3);
}

}  // namespace
}  // namespace lf::scene
