// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/trace.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace lf::scene {
namespace {

bool same(const Sphere& a, const Sphere& b) {
  return a.centre == b.centre && a.radius == b.radius && a.local_from_world == b.local_from_world;
}
bool same(const Capsule& a, const Capsule& b) { return a.base == b.base && a.axis == b.axis && a.radius == b.radius; }
bool same(const Cylinder& a, const Cylinder& b) {
  return a.x == b.x && a.z == b.z && a.radius == b.radius && a.top == b.top && a.bottom == b.bottom;
}
bool same(const Box& a, const Box& b) {
  return a.centre == b.centre && a.half == b.half && a.cosine == b.cosine && a.sine == b.sine;
}

Sphere ball_of(const Cylinder& p) {
  const float half = 0.5f * (p.bottom - p.top);
  return {{p.x, p.top + half, p.z}, std::hypot(p.radius, half), p.texture};
}
Sphere ball_of(const Box& b) { return {b.centre, b.radius, b.texture}; }
Sphere ball_of(const Group& g) { return {g.centre, g.radius, {}}; }

using Instants = std::span<const Objects>;

// Returns a sphere that contains the sphere sphere_at(o) for all instants `o`.
template <typename SphereAt>
Sphere hold_ball(Instants instants, const SphereAt& sphere_at) {
  Sphere held{0.5f * (sphere_at(instants.front()).centre + sphere_at(instants.back()).centre), 0, {}};
  for (const Objects& o : instants) {
    const Sphere s = sphere_at(o);
    held.radius = std::max(held.radius, glm::length(s.centre - held.centre) + s.radius);
  }
  return held;
}

// The distance of two moving points, each on its own segment, is largest at an end, so this capsule contains capsule i
// at all instants.
Capsule hold_rod(Instants instants, size_t i) {
  const Capsule &a = instants.front().capsules[i], &b = instants.back().capsules[i];
  Capsule held{0.5f * (a.base + b.base), 0.5f * (a.axis + b.axis), 0, {}};
  for (const Objects& o : instants) {
    const Capsule& c = o.capsules[i];
    const V3 base = c.base - held.base, end = base + c.axis - held.axis;
    held.radius = std::max(held.radius, std::max(glm::length(base), glm::length(end)) + c.radius);
  }
  return held;
}

// Sets changes[i] for each object i in [first, last) of `list`. Calls visit(i) for each object that changes.
template <typename Object, typename Visit>
void visit_changes(Instants instants, std::vector<Object> Objects::*list, size_t first, size_t last,
                   std::vector<bool>& changes, const Visit& visit) {
  const std::vector<Object>& before = instants.front().*list;
  changes.resize(before.size());
  for (size_t i = first; i < last; i++) {
    changes[i] = std::ranges::any_of(instants, [&](const Objects& o) { return !same((o.*list)[i], before[i]); });
    if (changes[i]) visit(i);
  }
}

template <typename Object>
void add_singles(Instants instants, std::vector<Object> Objects::*list, std::vector<bool>& changes,
                 std::vector<SceneChange::Part>& parts) {
  visit_changes(instants, list, 0, (instants.front().*list).size(), changes, [&](size_t i) {
    const Sphere ball = hold_ball(instants, [&](const Objects& o) { return ball_of((o.*list)[i]); });
    parts.push_back({ball, {ball}, {}});
  });
}

}  // namespace

SceneChange scene_change(std::span<const Objects> instants) {
  SceneChange movement;
  for (size_t g = 0; g < instants.front().groups.size(); g++) {
    const Group& group = instants.front().groups[g];
    SceneChange::Part part;
    visit_changes(instants, &Objects::spheres, group.first_sphere, group.last_sphere, movement.spheres, [&](size_t i) {
      part.balls.push_back(hold_ball(instants, [i](const Objects& o) { return o.spheres[i]; }));
    });
    visit_changes(instants, &Objects::capsules, group.first_capsule, group.last_capsule, movement.capsules,
                  [&](size_t i) { part.rods.push_back(hold_rod(instants, i)); });
    if (part.balls.empty() && part.rods.empty()) continue;
    part.around = hold_ball(instants, [g](const Objects& o) { return ball_of(o.groups[g]); });
    movement.parts.push_back(part);
  }
  add_singles(instants, &Objects::cylinders, movement.cylinders, movement.parts);
  add_singles(instants, &Objects::boxes, movement.boxes, movement.parts);
  return movement;
}

// The functions below intersect rays with spheres, capsules, cylinders and boxes in closed form (as collected by I.
// Quilez, iquilezles.org/articles/intersectors).
namespace {

using glm::dot;

constexpr float kMiss = std::numeric_limits<float>::infinity();
constexpr V3 kLight{-1.3f, -1.5f, 0.4f};
constexpr float kLightRadius = 0.22f;
constexpr float kPenumbra = 0.004f;  // half the width of a shadow's edge at its object, metres

// Uses the nearest approach, because the cancellation in the textbook discriminant is as large as a thin string.
float enter_sphere(const V3& from_centre, const V3& d, float radius) {
  const float b = dot(from_centre, d);
  const V3 nearest = from_centre - b * d;
  const float h = radius * radius - dot(nearest, nearest);
  return h > 0 ? -b - std::sqrt(h) : kMiss;
}

float enter_capsule(const Capsule& c, const V3& origin, const V3& d) {
  const V3 oa = origin - c.base;
  const float aa = dot(c.axis, c.axis), ad = dot(c.axis, d), ao = dot(c.axis, oa);
  const V3 across = d - (ad / aa) * c.axis, start = oa - (ao / aa) * c.axis;
  const float level = dot(across, across), b = dot(start, across) / level;
  const V3 nearest = start - b * across;
  const float h = c.radius * c.radius - dot(nearest, nearest);
  if (!(h >= 0)) return kMiss;
  const float t = -b - std::sqrt(h / level), along = ao + t * ad;
  if (along > 0 && along < aa) return t;
  return enter_sphere(along <= 0 ? oa : oa - c.axis, d, c.radius);
}

float enter_pillar(const Cylinder& p, const V3& origin, const V3& d, bool& on_top) {
  const float ox = origin.x - p.x, oz = origin.z - p.z;
  const float a = d.x * d.x + d.z * d.z, b = ox * d.x + oz * d.z, c = ox * ox + oz * oz - p.radius * p.radius;
  const float h = b * b - a * c;
  if (!(h > 0)) return kMiss;
  on_top = false;
  const float t = (-b - std::sqrt(h)) / a, y = origin.y + t * d.y;
  if (y > p.top && y < p.bottom) return t;
  if (!(d.y > 0)) return kMiss;
  const float top = (p.top - origin.y) / d.y, x = ox + top * d.x, z = oz + top * d.z;
  if (!(x * x + z * z < p.radius * p.radius)) return kMiss;
  on_top = true;
  return top;
}

V3 to_block(const Box& b, const V3& v) { return {b.cosine * v.x + b.sine * v.z, v.y, b.cosine * v.z - b.sine * v.x}; }
V3 from_block(const Box& b, const V3& v) { return {b.cosine * v.x - b.sine * v.z, v.y, b.sine * v.x + b.cosine * v.z}; }

// The points where a line enters the three slabs |x| < half, and where it leaves the first slab.
struct Slabs {
  V3 enter, leave;
  float near, far;
};
Slabs cross_slabs(const V3& origin, const V3& d, const V3& half) {
  // Avoids 0 / 0 and infinity - infinity for directions parallel to the slabs.
  const auto inverse = [](float v) { return 1 / (std::abs(v) < 1e-9f ? 1e-9f : v); };
  const V3 m(inverse(d.x), inverse(d.y), inverse(d.z)), n = m * origin, k = glm::abs(m) * half, enter = -n - k,
                                                        leave = k - n;
  return {enter, leave, std::max({enter.x, enter.y, enter.z}), std::min({leave.x, leave.y, leave.z})};
}

float enter_block(const Box& b, const V3& origin, const V3& d, V3& normal) {
  const V3 from_centre = origin - b.centre;
  const float along = dot(from_centre, d);
  if (dot(from_centre, from_centre) - along * along > b.radius * b.radius) return kMiss;
  const V3 local = to_block(b, d);
  const Slabs s = cross_slabs(to_block(b, from_centre), local, b.half);
  if (!(s.near < s.far)) return kMiss;
  V3 n(0, 0, 0);
  const int axis = s.near == s.enter.x ? 0 : s.near == s.enter.y ? 1 : 2;
  n[axis] = local[axis] > 0 ? -1.0f : 1.0f;
  normal = from_block(b, n);
  return s.near;
}

void leave_room(const V3& origin, const V3& d, Hit& hit) {
  const V3 centre = 0.5f * (kRoomMin + kRoomMax), half = 0.5f * (kRoomMax - kRoomMin);
  const Slabs s = cross_slabs(origin - centre, d, half);
  if (!(s.far > 0) || !(s.near < s.far)) return;
  const int axis = s.far == s.leave.z ? 2 : s.far == s.leave.y ? 1 : 0;
  hit.t = s.far;
  hit.kind = Kind::kRoom;
  hit.index = 2 * axis + (d[axis] > 0);
  hit.normal[axis] = d[axis] > 0 ? -1.0f : 1.0f;
}

bool in_front(float t, float limit) { return t > 0 && t < limit; }

void hit_groups(const Objects& o, const Ray& ray, Hit& hit) {
  for (const Group& g : o.groups) {
    const V3 from_centre = ray.origin - g.centre;
    const float b = dot(from_centre, ray.direction), c = dot(from_centre, from_centre) - g.radius * g.radius;
    const float h = b * b - c;
    if (h < 0 || (c > 0 && (b > 0 || -b - std::sqrt(h) > hit.t))) continue;
    for (uint32_t i = g.first_sphere; i < g.last_sphere; i++) {
      const Sphere& s = o.spheres[i];
      const float t = enter_sphere(ray.origin - s.centre, ray.direction, s.radius);
      if (in_front(t, hit.t)) hit = {t, Kind::kSphere, i, {}};
    }
    for (uint32_t i = g.first_capsule; i < g.last_capsule; i++) {
      const float t = enter_capsule(o.capsules[i], ray.origin, ray.direction);
      if (in_front(t, hit.t)) hit = {t, Kind::kCapsule, i, {}};
    }
  }
}

// Returns the fraction of light that passes an object at distance `along`. `gap` is the distance from the object's
// surface to the line of sight, negative inside.
float pass(float gap, float along, float spread) {
  const float width = along * spread + kPenumbra;
  return gap >= width ? 1 : gap <= -width ? 0 : ramp(-1, 1, gap / width);
}

// The nearest approach of a line of sight to an object: the gap to its surface, and the position along the line. The
// line starts at a point and runs along `d` for `distance`.
struct Approach {
  float gap, along;
};

Approach approach(const Capsule& c, const V3& point, const V3& d, float distance) {
  const V3 r = point - c.base;
  const float ad = dot(c.axis, d), rd = dot(r, d), aa = dot(c.axis, c.axis), ar = dot(c.axis, r);
  const float determinant = aa - ad * ad;
  float s = determinant > 1e-8f ? std::clamp((ad * ar - rd * aa) / determinant, 0.0f, distance) : 0;
  const float u = std::clamp((ad * s + ar) / aa, 0.0f, 1.0f);
  s = std::clamp(u * ad - rd, 0.0f, distance);
  return {glm::length(r + s * d - u * c.axis) - c.radius, s};
}

Approach approach(const Sphere& ball, const V3& point, const V3& d, float distance) {
  const V3 r = ball.centre - point;
  const float s = std::clamp(dot(r, d), 0.0f, distance);
  return {glm::length(r - s * d) - ball.radius, s};
}

template <typename Object>
float pass_round(const Object& object, const V3& point, const V3& d, float distance, float spread) {
  const Approach nearest = approach(object, point, d, distance);
  return pass(nearest.gap, nearest.along, spread);
}

float pass_block(const Box& b, const V3& point, const V3& d, float distance, float spread) {
  const V3 origin = to_block(b, point - b.centre), local = to_block(b, d);
  const Slabs slabs = cross_slabs(origin, local, b.half);
  const float s = std::clamp(0.5f * (slabs.near + slabs.far), 0.0f, distance);
  const V3 q = glm::abs(origin + s * local) - b.half;  // signed distance to a box
  const float gap = glm::length(glm::max(q, V3(0))) + std::min(std::max({q.x, q.y, q.z}), 0.0f);
  return pass(gap, s, spread);
}

bool may_shade(const V3& centre, float radius, const V3& point, const V3& d, float distance, float spread) {
  const V3 r = centre - point;
  const float s = dot(r, d);
  if (s < -radius || s > distance + radius) return false;
  const float reach = radius + (s + radius) * spread + kPenumbra;
  return dot(r, r) - s * s < reach * reach;
}

// Returns true if a cylinder may shade the point. The test is in the horizontal plane.
bool may_shade(const Cylinder& p, const V3& point, const V3& d, float distance, float spread) {
  const float x = p.x - point.x, z = p.z - point.z, level = d.x * d.x + d.z * d.z, along = x * d.x + z * d.z;
  const float reach = p.radius + distance * spread + kPenumbra, squared = x * x + z * z;
  if (along < 0 && squared > reach * reach) return false;
  const float off = x * d.z - z * d.x;
  return off * off < reach * reach * level || squared < reach * reach;
}

}  // namespace

Hit intersect_scene(const Objects& o, const Ray& ray) {
  Hit hit;
  leave_room(ray.origin, ray.direction, hit);
  if (hit.kind == Kind::kNothing) return hit;
  bool on_top = false;
  V3 block_normal(0);
  for (uint32_t i = 0; i < o.cylinders.size(); i++) {
    bool top = false;
    const float t = enter_pillar(o.cylinders[i], ray.origin, ray.direction, top);
    if (!in_front(t, hit.t)) continue;
    hit = {t, Kind::kCylinder, i, {}};
    on_top = top;
  }
  for (uint32_t i = 0; i < o.boxes.size(); i++) {
    V3 normal(0);
    const float t = enter_block(o.boxes[i], ray.origin, ray.direction, normal);
    if (!in_front(t, hit.t)) continue;
    hit = {t, Kind::kBox, i, {}};
    block_normal = normal;
  }
  hit_groups(o, ray, hit);

  const V3 p = ray.origin + hit.t * ray.direction;
  switch (hit.kind) {
    case Kind::kSphere: hit.normal = glm::normalize(p - o.spheres[hit.index].centre); break;
    case Kind::kCapsule: {
      const Capsule& c = o.capsules[hit.index];
      const float u = std::clamp(dot(p - c.base, c.axis) / dot(c.axis, c.axis), 0.0f, 1.0f);
      hit.normal = glm::normalize(p - c.base - u * c.axis);
      break;
    }
    case Kind::kCylinder: {
      const Cylinder& c = o.cylinders[hit.index];
      hit.normal = on_top ? V3(0, -1, 0) : glm::normalize(V3(p.x - c.x, 0, p.z - c.z));
      break;
    }
    case Kind::kBox: hit.normal = block_normal; break;
    case Kind::kRoom:
    case Kind::kNothing: break;
  }
  return hit;
}

float light_visibility(const Objects& o, const V3& point, const V3& d, float distance, float spread, Kind kind,
                       uint32_t index) {
  float seen = 1;
  for (const Group& g : o.groups) {
    if (!may_shade(g.centre, g.radius, point, d, distance, spread)) continue;
    for (uint32_t i = g.first_sphere; i < g.last_sphere; i++)
      if (kind != Kind::kSphere || index != i) seen *= pass_round(o.spheres[i], point, d, distance, spread);
    for (uint32_t i = g.first_capsule; i < g.last_capsule; i++)
      if (kind != Kind::kCapsule || index != i) seen *= pass_round(o.capsules[i], point, d, distance, spread);
  }
  for (uint32_t i = 0; i < o.cylinders.size(); i++) {
    if (kind == Kind::kCylinder && index == i) continue;
    const Cylinder& p = o.cylinders[i];
    if (!may_shade(p, point, d, distance, spread)) continue;
    // Uses the capsule inside the cylinder: penumbras are too soft to show the difference.
    const float top = p.top + 0.5f * p.radius;
    const Capsule inside{{p.x, top, p.z}, {0, p.bottom - top, 0}, 0.97f * p.radius, p.texture};
    seen *= pass_round(inside, point, d, distance, spread);
  }
  for (uint32_t i = 0; i < o.boxes.size(); i++) {
    const Box& b = o.boxes[i];
    if (kind == Kind::kBox && index == i) continue;
    if (may_shade(b.centre, b.radius, point, d, distance, spread)) seen *= pass_block(b, point, d, distance, spread);
  }
  return seen;
}

namespace {

// A line from a point to a light. `spread` is the radius of the light per metre of distance.
struct ShadowRay {
  V3 direction;
  float distance, spread;
};

ShadowRay key_light_from(const V3& point) {
  const V3 to_light = kLight - point;
  const float distance = glm::length(to_light);
  return {to_light / distance, distance, kLightRadius / distance};
}

// The room's own light on the floor comes from above.
constexpr ShadowRay kCeiling{{0, -1, 0}, 1.2f, 0.55f};
constexpr uint32_t kFloorFace = 3;

bool has_changed(const SceneChange& m, const HitPoint& sight) {
  switch (sight.kind) {
    case Kind::kSphere: return m.spheres[sight.index];
    case Kind::kCapsule: return m.capsules[sight.index];
    case Kind::kCylinder: return m.cylinders[sight.index];
    case Kind::kBox: return m.boxes[sight.index];
    case Kind::kRoom:
    case Kind::kNothing: break;
  }
  return false;
}

// Returns true if a moved object may shade the line, including the penumbras of light_visibility().
bool is_in_way(const SceneChange& m, const V3& point, const ShadowRay& light) {
  const auto ball_is = [&](const Sphere& b) {
    return may_shade(b.centre, b.radius, point, light.direction, light.distance, light.spread);
  };
  const auto rod_is = [&](const Capsule& c) {
    // The object inside the rod may have its nearest approach farther along the line.
    const Approach nearest = approach(c, point, light.direction, light.distance);
    const float along = std::min(light.distance, nearest.along + glm::length(c.axis) + 2 * c.radius);
    return nearest.gap < along * light.spread + kPenumbra;
  };
  return std::ranges::any_of(m.parts, [&](const SceneChange::Part& part) {
    return ball_is(part.around) && (std::ranges::any_of(part.balls, ball_is) || std::ranges::any_of(part.rods, rod_is));
  });
}

}  // namespace

bool is_unchanged(const SceneChange& movement, const V3& origin, const HitPoint& sight) {
  if (sight.kind == Kind::kNothing) return true;
  const V3 way = sight.point - origin;
  const float distance = glm::length(way);
  if (has_changed(movement, sight) || is_in_way(movement, origin, {way / distance, distance, 0})) return false;
  if (sight.is_lit && is_in_way(movement, sight.point, key_light_from(sight.point))) return false;
  return !(sight.kind == Kind::kRoom && sight.index == kFloorFace && is_in_way(movement, sight.point, kCeiling));
}

TraceResult trace(const Objects& o, const Ray& ray, ShadowCache& shadows) {
  const Hit hit = intersect_scene(o, ray);
  if (hit.kind == Kind::kNothing) return {V3(0), 0, {}};
  const uint32_t object = (static_cast<uint32_t>(hit.kind) << 16) | hit.index;
  const auto seen = [&](int number, const ShadowRay& light) {
    return shadows.seen(number, object, [&] {
      return light_visibility(o, ray.origin + hit.t * ray.direction, light.direction, light.distance, light.spread,
                              hit.kind, hit.index);
    });
  };
  Surface s;
  s.point = ray.origin + hit.t * ray.direction;
  s.normal = hit.normal;
  // The footprint is where neighbouring rays meet the tangent plane. It is limited to 20 times the footprint of a
  // facing plane.
  const float facing = std::min(dot(hit.normal, ray.direction), -0.05f);
  s.dx = hit.t * (ray.dx - ray.direction * (dot(hit.normal, ray.dx) / facing));
  s.dy = hit.t * (ray.dy - ray.direction * (dot(hit.normal, ray.dy) / facing));
  const Material finish = texture(o, hit.kind, hit.index, s);

  const ShadowRay key_light = key_light_from(s.point);
  const float distance = key_light.distance;
  const V3 l = key_light.direction;
  const float cosine = dot(hit.normal, l);
  float key = 0;
  if (cosine > 0) key = cosine * seen(0, key_light) * (3.3f / (1.9f + distance * distance * 0.16f));
  // The room's ambient light comes from above and from the side of the cameras, and is weaker where walls and floor
  // meet.
  float ambient = 0.30f - 0.10f * hit.normal.y - 0.07f * hit.normal.z;
  const V3 to_wall = glm::min(s.point - kRoomMin, kRoomMax - s.point);
  const float second = to_wall.x + to_wall.y + to_wall.z - std::min({to_wall.x, to_wall.y, to_wall.z}) -
                       std::max({to_wall.x, to_wall.y, to_wall.z});
  if (hit.kind == Kind::kRoom) {
    ambient *= 0.62f + 0.38f * ramp(-0.2f, 0.7f, second);
    if (hit.index == kFloorFace) ambient *= 0.35f + 0.65f * seen(1, kCeiling);
  }
  V3 light = finish.albedo * (V3(1.0f, 0.95f, 0.86f) * key + V3(0.90f, 0.96f, 1.06f) * ambient);
  if (finish.gloss > 0 && key > 0) {
    const float n_dot_h = std::max(0.0f, dot(hit.normal, glm::normalize(l - ray.direction)));
    const float p2 = n_dot_h * n_dot_h, p4 = p2 * p2, p8 = p4 * p4, p16 = p8 * p8;
    light += V3(finish.gloss * key / cosine * 0.5f * p16 * p16 * p8);
  }
  return {light, object, {s.point, hit.kind, cosine > 0, hit.index}};
}

}  // namespace lf::scene
