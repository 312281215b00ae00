// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/trial_nodes.h"

namespace lf {

void TrialRow::find(const RenderJob& job, const TrialCamera& camera, int row) {
  const ViewPlan& plan = job.plan();
  const auto room = static_cast<size_t>(camera.rect.width());
  for (auto* v : {&weight, &base[0], &base[1], &base[2], &slope[0], &slope[1], &slope[2], &x, &y}) v->resize(room);
  column.resize(room);
  seen.resize(room);
  count = 0;
  for (int c = camera.rect.x0; c < camera.rect.x1; c++) {
    const Vec2 ray = plan.rays().at(c, row);
    const float w = camera.corners.weight(plan, job.owners().at(c, row), ray);
    if (w == 0) continue;
    const Vec3 d(ray, 1), b = camera.projection.camera_from_ray() * d, s = camera.projection.per_inverse() * d;
    column[count] = c;
    weight[count] = w;
    for (int k = 0; k < 3; k++) {
      base[k][count] = static_cast<float>(b[k]);
      slope[k][count] = static_cast<float>(s[k]);
    }
    count++;
  }
}

void TrialRow::project(const FocalMap& map, const uint8_t* levels, const TrialCamera& camera, double eye_distance) {
  const Lens& lens = camera.projection.lens();
  const auto fx = static_cast<float>(lens.fx()), fy = static_cast<float>(lens.fy());
  const auto cx = static_cast<float>(lens.cx()), cy = static_cast<float>(lens.cy());
  const auto k1 = static_cast<float>(lens.k1()), k2 = static_cast<float>(lens.k2());
  const auto p1 = static_cast<float>(lens.p1()), p2 = static_cast<float>(lens.p2());
  const auto max_r2 = static_cast<float>(std::min(lens.max_radius() * lens.max_radius(), 1e30));
  const auto far_end = static_cast<float>(map.farthest);
  const auto scale = static_cast<float>((map.nearest - map.farthest) / FocalMap::kLevels);
  const auto eye = static_cast<float>(eye_distance);
  for (size_t i = 0; i < count; i++) {
    const float s = far_end + scale * static_cast<float>(levels[column[i]]);
    const float z = base[2][i] + s * slope[2][i], inverse = 1 / z;
    const float u = (base[0][i] + s * slope[0][i]) * inverse, v = (base[1][i] + s * slope[1][i]) * inverse;
    const float r2 = u * u + v * v, stretch = 1 + r2 * (k1 + r2 * k2);
    const float px = fx * (u * stretch + 2 * p1 * u * v + p2 * (r2 + 2 * u * u)) + cx;
    const float py = fy * (v * stretch + p1 * (r2 + 2 * v * v) + 2 * p2 * u * v) + cy;
    seen[i] = (z > 0) & (1 - s * eye > 0) & (r2 <= max_r2) & (px >= -0.5f) & (px <= camera.width - 0.5f) &
              (py >= -0.5f) & (py <= camera.height - 0.5f);
    x[i] = px;
    y[i] = py;
  }
}

}  // namespace lf
