// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/sum_tables.h"

#include <algorithm>
#include <cmath>

#include "render/camera_projection.h"
#include "render/gl/sum_shader.h"

namespace lf::gl {
namespace {

// Texels of faces and slots.
class Tables {
 public:
  explicit Tables(std::vector<float>& values) : values_(values) { values_.clear(); }
  void add(double x, double y, double z, double w) {
    for (const double v : {x, y, z, w}) values_.push_back(static_cast<float>(v));
  }
  void add(const float* v, double w) { add(v[0], v[1], v[2], w); }
  int texels() const { return static_cast<int>(values_.size() / 4); }

 private:
  std::vector<float>& values_;
};

void add_face(Tables& tables, const simd::SumTask& task, const FacePlan& face) {
  const Rays& rays = task.plan->rays();
  Vec3 edge[3] = {face.edge[0], face.edge[1], face.edge[2]};
  Vec2 anchor(0);
  if (rays.separable()) {  // linear in the pixel, and small near where it is 0
    const Vec2 first = rays.at(0, 0);
    const Vec2 step(rays.at(1, 0).x - first.x, rays.at(0, 1).y - first.y);
    anchor = Vec2((face.rect.x0 + face.rect.x1) / 2, (face.rect.y0 + face.rect.y1) / 2);
    const Vec2 ray = rays.at(static_cast<int>(anchor.x), static_cast<int>(anchor.y));
    for (Vec3& e : edge) e = Vec3(e.x * step.x, e.y * step.y, FacePlan::evaluate(e, ray));
  }
  double largest = 0;
  for (const Vec3& e : edge)
    largest = std::max({largest, std::abs(e.x) * face.rect.width(), std::abs(e.y) * face.rect.height(), std::abs(e.z)});
  tables.add(anchor.x, anchor.y, 0, 0);
  for (int k = 0; k < 3; k++) {
    const Vec3 e = largest > 0 ? edge[k] / largest : edge[k];
    const int32_t slot = face.camera[k] == MeshFace::kNone ? -1 : task.slot_of_camera[face.camera[k]];
    tables.add(e.x, e.y, e.z, slot);
  }
}

void add_slot(Tables& tables, const simd::SumTask& task, const simd::Slot& slot, int layer) {
  const ViewPlan& plan = *task.plan;
  const FocalMap* map = plan.view().focus.map.get();
  simd::ProjectionTerms terms;
  int x = 0, y = 0;
  if (plan.rays().separable()) {
    x = (slot.rect.x0 + slot.rect.x1) / 2;
    y = (slot.rect.y0 + slot.rect.y1) / 2;
    terms = map ? simd::terms_at(slot, x, y, plan.inverse_at(x, y)) : simd::terms_at(slot, x, y);
  } else {
    terms.near = map ? plan.inverse_at(plan.view().width / 2.0, plan.view().height / 2.0) : 0;
    const Mat3& per = slot.projection->per_inverse();
    const Mat3 from = map ? slot.projection->camera_from_ray() + terms.near * per : slot.projection->camera_from_ray();
    double largest = 1e-300;
    for (int c = 0; c < 3; c++)
      for (int r = 0; r < 3; r++) largest = std::max(largest, std::abs(from[c][r]));
    for (int r = 0; r < 3; r++) {
      const auto scaled = [&](double v) { return static_cast<float>(v / largest); };
      terms.along[r] = scaled(from[0][r]);
      terms.down[r] = scaled(from[1][r]);
      terms.from[r] = scaled(from[2][r]);
      terms.per_along[r] = map ? scaled(per[0][r]) : 0;
      terms.per_down[r] = map ? scaled(per[1][r]) : 0;
      terms.per_from[r] = map ? scaled(per[2][r]) : 0;
    }
  }
  const double level = map && map->nearest != map->farthest
                           ? (terms.near - map->farthest) / (map->nearest - map->farthest) * FocalMap::kLevels
                           : 0;
  const int flags = (slot.image.family != PixelFamily::kNone ? kHasImage : 0) |
                    (slot.radial || slot.tangential ? kIsDistorted : 0) | (slot.is_cubic() ? kIsCubic : 0);
  tables.add(terms.from, x);
  tables.add(terms.along, y);
  tables.add(terms.down, flags);
  tables.add(terms.per_from, level);
  tables.add(terms.per_along, plan.eye_distance());
  tables.add(terms.per_down, terms.near);
  tables.add(slot.fx, slot.fy, slot.cx, slot.cy);
  tables.add(slot.k1, slot.k2, slot.p1, slot.p2);
  tables.add(slot.max_r2, slot.image.width, slot.image.height, layer);
  const RgbLayout& layout = slot.image.layout;
  tables.add(layout.r, layout.g, layout.b, 0);
}

}  // namespace

int make_tables(const simd::SumTask& task, std::vector<float>& values) {
  Tables table(values);
  for (const FacePlan& face : task.plan->faces()) add_face(table, task, face);
  const int first_slot = table.texels();
  int layer = 0;
  for (const simd::Slot& slot : task.slots) add_slot(table, task, slot, layer++);
  const int rows = (table.texels() + kTableWidth - 1) / kTableWidth;
  values.resize(static_cast<size_t>(rows) * kTableWidth * 4);
  return first_slot;
}

}  // namespace lf::gl
