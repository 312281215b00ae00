// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/trial_nodes.h"

#include <gtest/gtest.h>

#include <cmath>

#include "lib/focus/array_of_walls.h"
#include "render/camera_projection.h"

namespace lf {
namespace {

// Against the rule in double precision: every node that a camera has a weight in and sees, once, where it sees it.
TEST(TrialNodes, AreThoseOfTheRule) {
  const test::ArrayOfWalls walls;
  View wide = walls.view(100);
  wide.lens = Lens::from_fov_y(50, wide.width, wide.height);
  const View view = trial_view(wide);
  const RenderJob job(walls.rig, walls.mesh, view, walls.own);
  const size_t nodes = view.focus.map->levels.size();
  const std::vector<std::vector<uint8_t>> levels{std::vector<uint8_t>(nodes, 20), std::vector<uint8_t>(nodes, 230)};
  size_t seen = 0, unseen = 0;
  for (const CameraIndex camera : job.cameras()) {
    const TrialCamera at(job, camera, walls.rig.cameras[camera]);
    const CameraProjection projection(job.plan(), camera, walls.rig.cameras[camera]);
    std::vector<std::vector<Vec3>> found(levels.size(), std::vector<Vec3>(nodes));
    for_trial_nodes(at, view.width, levels, [&](size_t t, size_t node, float weight, float x, float y) {
      EXPECT_EQ(found[t][node].z, 0);
      found[t][node] = {x, y, weight};
    });
    for (size_t t = 0; t < levels.size(); t++)
      for (int j = 0; j < view.height; j++)
        for (int i = 0; i < view.width; i++) {
          const size_t node = static_cast<size_t>(j) * view.width + i;
          const Vec2 ray = job.plan().rays().at(i, j);
          const float weight = CameraCorners(job.plan(), camera).weight(job.plan(), job.owners().at(i, j), ray);
          Vec2 pixel;
          const bool sees = weight > 0 && projection.project(ray, view.focus.map->inverse_of(levels[t][node]), pixel);
          (sees ? seen : unseen) += weight > 0;
          ASSERT_EQ(found[t][node].z > 0, sees) << i << ", " << j;
          if (!sees) continue;
          // The array is parallel to the view: see weigh_run(). The weight that is expected was rounded, too.
          EXPECT_NEAR(found[t][node].z, weight, std::ldexp(6 + 3 + 1, -24));
          EXPECT_NEAR(found[t][node].x, pixel.x, 1e-3);
          EXPECT_NEAR(found[t][node].y, pixel.y, 1e-3);
        }
  }
  EXPECT_GT(seen, nodes);
  EXPECT_GT(unseen, 0u);
}

TEST(TrialNodes, LieRowByRow) {
  const test::ArrayOfWalls walls;
  const View view = trial_view(walls.view(100));
  const RenderJob job(walls.rig, walls.mesh, view, walls.own);
  std::vector<uint8_t> levels(view.focus.map->levels);
  for (size_t i = 0; i < levels.size(); i++) levels[i] = static_cast<uint8_t>(7 * i);
  size_t rows = 0;
  for (const CameraIndex camera : job.cameras()) {
    const TrialCamera at(job, camera, walls.rig.cameras[camera]);
    const ByteBuffer picked = at.levels_of({{levels, levels}}, view.width);
    const size_t next_trial = at.u.size();
    int next = 0;
    Rect bounds;
    for (const TrialRow& row : at.rows) {
      EXPECT_EQ(row.first, next);
      next += row.x1 - row.x0;
      bounds = unite(bounds, {row.x0, row.y, row.x1, row.y + 1});
      for (int x = row.x0; x < row.x1; x++) {
        const auto i = static_cast<size_t>(row.first + x - row.x0);
        EXPECT_EQ(picked[next_trial + i], levels[static_cast<size_t>(row.y) * view.width + x]);
        EXPECT_EQ(at.u[i], static_cast<float>(job.plan().rays().at(x, row.y).x));
        EXPECT_EQ(at.v[i], static_cast<float>(job.plan().rays().at(x, row.y).y));
      }
    }
    EXPECT_EQ(at.rays().count, next);
    EXPECT_EQ(picked.size(), 2 * (next + kTrialSpare));
    EXPECT_EQ(bounds, at.rect);
    rows += at.rows.size();
  }
  EXPECT_GE(rows, static_cast<size_t>(view.height));
}

}  // namespace
}  // namespace lf
