// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/movement.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace lf::scene {
namespace {

bool same(const Sphere& a, const Sphere& b) {
  return a.centre == b.centre && a.radius == b.radius && a.local_from_world == b.local_from_world;
}
bool same(const Capsule& a, const Capsule& b) { return a.base == b.base && a.axis == b.axis && a.radius == b.radius; }
bool same(const Pillar& a, const Pillar& b) {
  return a.x == b.x && a.z == b.z && a.radius == b.radius && a.top == b.top && a.bottom == b.bottom;
}
bool same(const Block& a, const Block& b) {
  return a.centre == b.centre && a.half == b.half && a.cosine == b.cosine && a.sine == b.sine;
}

Sphere ball_of(const Pillar& p) {
  const float half = 0.5f * (p.bottom - p.top);
  return {{p.x, p.top + half, p.z}, std::hypot(p.radius, half), p.paint};
}
Sphere ball_of(const Block& b) { return {b.centre, b.radius, b.paint}; }
Sphere ball_of(const Group& g) { return {g.centre, g.radius, {}}; }

// Bounds of both.
Sphere hold(const Sphere& a, const Sphere& b) {
  return {0.5f * (a.centre + b.centre), 0.5f * glm::length(a.centre - b.centre) + std::max(a.radius, b.radius), {}};
}
// No point of a segment is farther from the like point of another than one of its ends is.
Capsule hold(const Capsule& a, const Capsule& b) {
  const float base = glm::length(a.base - b.base), end = glm::length(a.base + a.axis - b.base - b.axis);
  return {0.5f * (a.base + b.base), 0.5f * (a.axis + b.axis), 0.5f * std::max(base, end) + std::max(a.radius, b.radius),
          {}};
}

// Sets changes[i] for each i in [first, last). Calls visit(i) if the objects differ.
template <typename Object, typename Visit>
void visit_changes(const std::vector<Object>& before, const std::vector<Object>& after, size_t first, size_t last,
                   std::vector<bool>& changes, const Visit& visit) {
  changes.resize(before.size());
  for (size_t i = first; i < last; i++) {
    changes[i] = !same(before[i], after[i]);
    if (changes[i]) visit(i);
  }
}

template <typename Object>
void add_singles(const std::vector<Object>& before, const std::vector<Object>& after, std::vector<bool>& changes,
                 std::vector<Movement::Part>& parts) {
  visit_changes(before, after, 0, before.size(), changes, [&](size_t i) {
    const Sphere ball = hold(ball_of(before[i]), ball_of(after[i]));
    parts.push_back({ball, {ball}, {}});
  });
}

}  // namespace

Movement movement_between(const Objects& before, const Objects& after) {
  Movement movement;
  for (size_t g = 0; g < before.groups.size(); g++) {
    const Group& group = before.groups[g];
    Movement::Part part{hold(ball_of(group), ball_of(after.groups[g])), {}, {}};
    visit_changes(before.spheres, after.spheres, group.first_sphere, group.last_sphere, movement.spheres,
                  [&](size_t i) { part.balls.push_back(hold(before.spheres[i], after.spheres[i])); });
    visit_changes(before.capsules, after.capsules, group.first_capsule, group.last_capsule, movement.capsules,
                  [&](size_t i) { part.rods.push_back(hold(before.capsules[i], after.capsules[i])); });
    if (!part.balls.empty() || !part.rods.empty()) movement.parts.push_back(part);
  }
  add_singles(before.pillars, after.pillars, movement.pillars, movement.parts);
  add_singles(before.blocks, after.blocks, movement.blocks, movement.parts);
  return movement;
}

}  // namespace lf::scene
