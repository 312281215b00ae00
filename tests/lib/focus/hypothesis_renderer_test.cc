// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/hypothesis_renderer.h"

#include "lib/focus/array_of_walls.h"
#include "render/camera_projection.h"
#include "render/ownership.h"
#include "support/test.h"

namespace lf {
namespace {

// Calls fn(hypothesis, node of the map, weight, x, y in the camera's image) for every visible node. weigh_run() states
// the precision of the weights. `hypotheses`: levels of each hypothesis.
template <class Fn>
void for_hypothesis_nodes(const HypothesisCamera& camera, int columns, std::span<const std::vector<uint8_t>> hypotheses,
                          const Fn& fn) {
  const HypothesisRays rays = camera.rays();
  std::vector<float> x(rays.count), y(rays.count);
  std::vector<uint8_t> seen(rays.count);
  const ByteBuffer levels = camera.levels_of(hypotheses, columns);
  for (size_t t = 0; t < hypotheses.size(); t++) {
    project_hypothesis(camera.projection, rays, &levels[t * camera.u.size()], x.data(), y.data(), seen.data());
    for (const HypothesisRow& row : camera.rows) {
      const size_t begin = static_cast<size_t>(row.y) * columns + row.x0;
      for (int k = 0; k < row.x1 - row.x0; k++) {
        const int i = row.first + k;
        if (seen[i] && camera.weight[i] > 0) fn(t, begin + k, camera.weight[i], x[i], y[i]);
      }
    }
  }
}

// Compares with the rule in double precision: every node with weight that the camera sees, exactly once, at the right
// position.
TEST(HypothesisNodes, MatchTheRule) {
  const test::ArrayOfWalls walls;
  View wide = walls.view(100);
  wide.lens = Lens::from_fov_y(50, wide.width, wide.height);
  const View view = hypothesis_view(wide);
  const RenderJob job(walls.rig, walls.mesh, view, walls.own);
  const FaceIdMap owners(job.runs());
  const size_t nodes = view.focus.map->levels.size();
  const std::vector<std::vector<uint8_t>> levels{std::vector<uint8_t>(nodes, 20), std::vector<uint8_t>(nodes, 230)};
  size_t seen = 0, unseen = 0;
  for (const CameraIndex camera : job.cameras()) {
    const HypothesisCamera at(job, camera, walls.rig.cameras[camera]);
    const CameraProjection projection(job.plan(), camera, walls.rig.cameras[camera]);
    std::vector<std::vector<Vec3>> found(levels.size(), std::vector<Vec3>(nodes));
    for_hypothesis_nodes(at, view.width, levels, [&](size_t t, size_t node, float weight, float x, float y) {
      EXPECT_EQ(found[t][node].z, 0);
      found[t][node] = {x, y, weight};
    });
    for (size_t t = 0; t < levels.size(); t++)
      for (int j = 0; j < view.height; j++)
        for (int i = 0; i < view.width; i++) {
          const size_t node = static_cast<size_t>(j) * view.width + i;
          const Vec2 ray = job.plan().rays().at(i, j);
          const float weight = CameraCorners(job.plan(), camera).weight(job.plan(), owners.at(i, j), ray);
          Vec2 pixel;
          const bool sees = weight > 0 && projection.project(ray, view.focus.map->inverse_of(levels[t][node]), pixel);
          (sees ? seen : unseen) += weight > 0;
          ASSERT_EQ(found[t][node].z > 0, sees) << i << ", " << j;
          if (!sees) continue;
          // Parallel array: see weigh_run() for the bound. The expected weight is rounded as well.
          EXPECT_NEAR(found[t][node].z, weight, std::ldexp(6 + 3 + 1, -24));
          EXPECT_NEAR(found[t][node].x, pixel.x, 1e-3);
          EXPECT_NEAR(found[t][node].y, pixel.y, 1e-3);
        }
  }
  EXPECT_GT(seen, nodes);
  EXPECT_GT(unseen, 0u);
}

TEST(HypothesisNodes, AreStoredRowByRow) {
  const test::ArrayOfWalls walls;
  const View view = hypothesis_view(walls.view(100));
  const RenderJob job(walls.rig, walls.mesh, view, walls.own);
  std::vector<uint8_t> levels(view.focus.map->levels);
  for (size_t i = 0; i < levels.size(); i++) levels[i] = static_cast<uint8_t>(7 * i);
  size_t rows = 0;
  for (const CameraIndex camera : job.cameras()) {
    const HypothesisCamera at(job, camera, walls.rig.cameras[camera]);
    const ByteBuffer picked = at.levels_of({{levels, levels}}, view.width);
    const size_t next_hypothesis = at.u.size();
    int next = 0;
    Rect bounds;
    for (const HypothesisRow& row : at.rows) {
      EXPECT_EQ(row.first, next);
      next += row.x1 - row.x0;
      bounds = unite(bounds, {row.x0, row.y, row.x1, row.y + 1});
      for (int x = row.x0; x < row.x1; x++) {
        const auto i = static_cast<size_t>(row.first + x - row.x0);
        EXPECT_EQ(picked[next_hypothesis + i], levels[static_cast<size_t>(row.y) * view.width + x]);
        EXPECT_EQ(at.u[i], static_cast<float>(job.plan().rays().at(x, row.y).x));
        EXPECT_EQ(at.v[i], static_cast<float>(job.plan().rays().at(x, row.y).y));
      }
    }
    EXPECT_EQ(at.rays().count, next);
    EXPECT_EQ(picked.size(), 2 * (next + kHypothesisPadding));
    EXPECT_EQ(bounds, at.rect);
    rows += at.rows.size();
  }
  EXPECT_GE(rows, static_cast<size_t>(view.height));
}

using enum DepthHypothesis::Kind;
using test::ArrayOfWalls;

TEST(HypothesisRenderer, CamerasAgreeAtTheSurface) {
  const ArrayOfWalls walls;
  const View view = walls.view(60);
  const std::vector<PhotoConsistency> moments =
      walls.moments(view, {{kPlane, 60}, {kPlane, 170}, {kPlane, 240}}, walls.own);
  const auto mean_deviation = [&](size_t hypothesis, bool right) {
    double sum = 0;
    int count = 0;
    for (int j = 5; j < 25; j++)
      for (int i = right ? 25 : 5; i < (right ? 35 : 15); i++, count++)
        sum += moments[hypothesis].deviation(j * 40 + i);
    return sum / count;
  };
  EXPECT_LT(mean_deviation(0, false), 1.5);
  EXPECT_LT(mean_deviation(1, true), 1.5);
  EXPECT_GT(mean_deviation(1, false), 4);
  EXPECT_GT(mean_deviation(0, true), 4);
  EXPECT_GT(mean_deviation(2, true), 2.5);
}

// Blended by angle, weights add up to 1 outside the hull too, and any grouping of cameras gives the same sum.
TEST(HypothesisRenderer, NearestCamerasHaveWeightsOutsideTheHull) {
  const ArrayOfWalls walls;
  View view = walls.view(170);
  const Vec3& corner = walls.rig.cameras.back().pose.position;
  view.pose.position = corner + 0.5 * (corner - walls.rig.cameras[4].pose.position);
  const std::vector<DepthHypothesis> hypotheses{{kPlane, 60}, {kPlane, 170}};
  view.blending.extrapolates = false;
  const std::vector<PhotoConsistency> by_mesh = walls.moments(view, hypotheses, walls.own);
  for (const uint16_t weight : by_mesh[0].weight) ASSERT_EQ(weight, 0);
  view.blending = {Blending::Kind::kAngle, 0, 9};
  ASSERT_EQ(hypothesis_view(view).blending.nearest, kHypothesisCameras) << "limited to kHypothesisCameras";
  const std::vector<PhotoConsistency> all = walls.moments(view, hypotheses, walls.own);
  for (size_t t = 0; t < hypotheses.size(); t++) {
    EXPECT_GT(std::ranges::count(all[t].weight, PhotoConsistency::kWeightOne), all[t].weight.size() / 2) << t;
    EXPECT_LE(std::ranges::max(all[t].weight), PhotoConsistency::kWeightOne) << t;
  }
  const RenderJob job(walls.rig, walls.mesh, hypothesis_view(view), walls.own);
  for (const CameraIndex camera : job.cameras()) {
    const HypothesisCamera at(job, camera, walls.rig.cameras[camera]);
    for (const HypothesisRow& row : at.rows)
      for (int x = row.x0; x < row.x1; x++)
        ASSERT_EQ(at.weight[static_cast<size_t>(row.first + x - row.x0)] * PhotoConsistency::kWeightOne,
                  job.plan().blend()->weight(camera, x, row.y));
  }
  std::vector<PhotoConsistency> parts = walls.moments(view, hypotheses, {0, 1, 2, 3, 4});
  const std::vector<PhotoConsistency> others = walls.moments(view, hypotheses, {5, 6, 7, 8});
  for (size_t t = 0; t < hypotheses.size(); t++) {
    parts[t].add(others[t]);
    EXPECT_EQ(parts[t].weight, all[t].weight);
    EXPECT_EQ(parts[t].luma, all[t].luma);
    EXPECT_EQ(parts[t].square, all[t].square);
  }
}

TEST(HypothesisRenderer, SumsMatchTheRule) {
  const ArrayOfWalls walls;
  const View view = walls.view(100), hypothesis = hypothesis_view(view);
  const std::vector<PhotoConsistency> moments = walls.moments(view, {{kPlane, 130}}, walls.own);
  const ViewPlan plan(walls.rig, walls.mesh, hypothesis);
  const FaceIdMap owners(plan, {0, 0, hypothesis.width, hypothesis.height});
  double worst_mean = 0;
  for (int j = 0; j < hypothesis.height; j++)
    for (int i = 0; i < hypothesis.width; i++) {
      const Vec2 ray = plan.rays().at(i, j);
      double weight = 0, luma = 0;
      for (CameraIndex camera = 0; camera < walls.rig.cameras.size(); camera++) {
        const double w = CameraCorners(plan, camera).weight(plan, owners.at(i, j), ray);
        Vec2 pixel;
        if (w == 0 || !CameraProjection(plan, camera, walls.rig.cameras[camera])
                           .project(ray, hypothesis.focus.map->inverse_of(130), pixel))
          continue;
        const Image& image = walls.images[camera];
        double mean = 0;  // over the box, bilinear between pixels
        for (int y = 0; y < 4; y++)
          for (int x = 0; x < 4; x++) {
            const double px = std::clamp(pixel.x + x - 1.5, 0., 159.), py = std::clamp(pixel.y + y - 1.5, 0., 119.);
            const int x0 = std::min(static_cast<int>(px), 158), y0 = std::min(static_cast<int>(py), 118);
            const auto at = [&](int k, int l) { return image.data()[3 * (l * 160 + k)]; };
            const double a = px - x0, b = py - y0;
            mean += ((1 - b) * ((1 - a) * at(x0, y0) + a * at(x0 + 1, y0)) +
                     b * ((1 - a) * at(x0, y0 + 1) + a * at(x0 + 1, y0 + 1))) /
                    16;
          }
        weight += w;
        luma += w * mean;
      }
      const size_t node = static_cast<size_t>(j) * hypothesis.width + i;
      EXPECT_NEAR(moments[0].weight[node] / 32768., weight, 1e-4);
      if (weight < 0.99) continue;
      worst_mean = std::max(worst_mean, std::abs(moments[0].luma[node] / 128. - luma));
    }
  EXPECT_GT(worst_mean, 0);
  EXPECT_LT(worst_mean, 1.5) << "two roundings to 8 bits, and to 256ths of a pixel";
}

TEST(HypothesisRenderer, MasksReduceTheWeightsOfTheSurfaceOnly) {
  const ArrayOfWalls walls;
  const View view = walls.view(60);
  const FocalMap& map = *view.focus.map;
  const std::vector<DepthHypothesis> hypotheses{{kBlurred, 0}, {kPlane, 170}};
  const std::vector<std::vector<uint8_t>> levels = hypothesis_levels(view, hypotheses);
  const RenderJob job(walls.rig, walls.mesh, hypothesis_view(view), walls.own);
  std::vector<VisibilityMask> masks(walls.own.size(), {map.columns, map.rows, {}, {}});
  std::vector<double> expected(map.levels.size());
  std::vector<Source> sources;
  for (const CameraIndex camera : job.cameras()) {
    for (size_t i = 0; i < map.levels.size(); i++)
      masks[camera].nodes.push_back(static_cast<uint8_t>(VisibilityMask::kHidden + (37 * i + 11 * camera) % 192));
    const std::vector<PhotoConsistency> own = walls.moments(view, hypotheses, {camera});
    for (size_t i = 0; i < expected.size(); i++) expected[i] += own[0].weight[i] * masks[camera].nodes[i] / 255.;
    sources.push_back(walls.sources()[camera]);
    sources.back().visibility = &masks[camera];
  }
  std::vector<PhotoConsistency> masked(hypotheses.size());
  for (PhotoConsistency& sum : masked) sum.reset(map.columns, map.rows);
  add_consistency(job, sources, levels, masked);
  for (size_t i = 0; i < expected.size(); i++)
    ASSERT_NEAR(masked[0].weight[i], expected[i], 3) << i << ": three cameras, each rounded twice";
  const std::vector<PhotoConsistency> whole = walls.moments(view, hypotheses, walls.own);
  EXPECT_EQ(masked[1].weight, whole[1].weight);
  EXPECT_EQ(masked[1].luma, whole[1].luma);
  EXPECT_EQ(masked[1].square, whole[1].square);
}

TEST(HypothesisRenderer, PartsOfAnArrayAddUpToTheWhole) {
  const ArrayOfWalls walls;
  const View view = walls.view(60);
  const std::vector<DepthHypothesis> hypotheses{{kBlurred, 0}, {kShifted, 40}};
  const std::vector<PhotoConsistency> whole = walls.moments(view, hypotheses, walls.own);
  std::vector<PhotoConsistency> sum = walls.moments(view, hypotheses, {0, 1, 2, 3});
  const std::vector<PhotoConsistency> rest = walls.moments(view, hypotheses, {4, 5, 6, 7, 8});
  for (size_t t = 0; t < hypotheses.size(); t++) {
    sum[t].add(rest[t]);
    EXPECT_EQ(sum[t].weight, whole[t].weight);
    EXPECT_EQ(sum[t].luma, whole[t].luma);
    EXPECT_EQ(sum[t].square, whole[t].square);
  }
}

}  // namespace

}  // namespace lf
