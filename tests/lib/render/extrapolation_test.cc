// SPDX-License-Identifier: LGPL-2.1-or-later
// Pixels beside the camera mesh and in its gaps: weights against the formula in 80-bit floating point, continuity at the
// border, and unchanged pixels elsewhere.
#include "render/extrapolation.h"

#include "lib/render/production.h"
#include "reference/generators.h"
#include "reference/renderer.h"
#include "render/contribution_map.h"
#include "support/test.h"

namespace lf {
namespace {

using reference::Random;
using reference::Real;
using reference::V3;
using test::Production;

constexpr int kWidth = 93, kHeight = 71, kStep = WeightGrid::kStep;

View view_from(const Vec3& eye, const Quat& turn = {1, 0, 0, 0}) {
  View view = reference::view_at(eye, turn);
  view.width = kWidth;
  view.height = kHeight;
  view.lens = Lens::from_fov_y(60, kWidth, kHeight);
  view.blending = {};
  return view;
}

bool is_beside(const Production& p, int x, int y) {
  const int32_t owner = p.owners.at(x, y);
  return owner != FaceIdMap::kNone && !p.plan.faces()[owner].has_corners();
}

double weight_at(const Production& p, CameraIndex camera, int x, int y) {
  return CameraCorners(p.plan, camera).weight_at(p.plan, p.owners, x, y);
}

std::vector<double> weights_at(const Production& p, int x, int y) {
  std::vector<double> weights;
  for (CameraIndex i = 0; i < p.plan.num_cameras(); i++) weights.push_back(weight_at(p, i, x, y));
  return weights;
}

// The border edges of a mesh of triangles: the edges of a single face.
std::vector<std::pair<CameraIndex, CameraIndex>> border_of(const Mesh& mesh) {
  std::map<std::pair<CameraIndex, CameraIndex>, int> count;
  for (const MeshFace& face : mesh.faces)
    for (int k = 0; k < 3; k++) count[std::minmax(face.camera[k], face.camera[(k + 1) % 3])]++;
  std::vector<std::pair<CameraIndex, CameraIndex>> border;
  for (const auto& [edge, faces] : count)
    if (faces == 1) border.push_back(edge);
  return border;
}

// The formula of render/extrapolation.h for a pixel beside the mesh; `by_angle` has the weights of kAngle.
std::vector<Real> expected_weights(const Rig& rig, const Mesh& mesh, const View& view, const Vec2& ray,
                                   const std::vector<Real>& by_angle) {
  const V3 line = reference::rotate(view.pose.orientation, {ray.x, ray.y, 1}), d = (1 / reference::norm(line)) * line;
  const auto place = [&](CameraIndex i) {
    return reference::to_v3(rig.cameras[i].pose.position) - reference::to_v3(view.pose.position);
  };
  const auto border = border_of(mesh);
  std::vector<Real> lengths;
  for (const auto& [a, b] : border) lengths.push_back(reference::norm(place(b) - place(a)));
  std::ranges::sort(lengths);
  const Real length = lengths[lengths.size() / 2];
  Real least = INFINITY, part = 0, depth = 0;
  std::pair<CameraIndex, CameraIndex> nearest;
  for (const auto& [a, b] : border) {
    const V3 facing = reference::rotate(rig.cameras[a].pose.orientation, {0, 0, 1}) +
                      reference::rotate(rig.cameras[b].pose.orientation, {0, 0, 1});
    if (!(reference::dot(facing, d) > 0)) continue;
    // The distance to the line of sight is convex along the edge: ternary search.
    Real low = 0, high = 1;
    const auto distance = [&](Real s) {
      return reference::norm(reference::cross(place(a) + s * (place(b) - place(a)), d));
    };
    for (int i = 0; i < 200; i++) {
      const Real third = (high - low) / 3;
      (distance(low + third) > distance(high - third) ? low : high) =
          distance(low + third) > distance(high - third) ? low + third : high - third;
    }
    if (const Real found = distance((low + high) / 2); found < least) {
      least = found;
      part = (low + high) / 2;
      depth = std::abs(reference::dot(place(a) + part * (place(b) - place(a)), d));
      nearest = {a, b};
    }
  }
  const Real fading = std::max<Real>(length / 4, 32 * depth / view.lens.fx());
  const Real t = std::min<Real>(least / fading, 1), share = least < INFINITY ? t * t * (3 - 2 * t) : 1;
  std::vector<Real> weights(rig.cameras.size());
  for (size_t i = 0; i < weights.size(); i++) weights[i] = share * by_angle[i];
  if (least < INFINITY) {
    weights[nearest.first] += (1 - share) * (1 - part);
    weights[nearest.second] += (1 - share) * part;
  }
  return weights;
}

TEST(Extrapolation, WeightsFollowTheFormula) {
  double worst = 0;
  int compared = 0;
  for (int seed = 0; seed < 12; seed++) {
    Random random(seed);
    const Rig rig = reference::planar_grid(3 + seed % 3, 4, 0.5);
    const Mesh mesh = build_mesh(rig);
    View view = view_from(random.point_in_box(2) - Vec3(0, 0, 0.5), random.small_rotation(0.3));
    view.blending.fills_gaps = false;
    const Production production(rig, mesh, view);
    const ViewPlan& plan = production.plan;
    if (!plan.blend()) continue;
    View angle = view;
    angle.blending = {.kind = Blending::Kind::kAngle, .nearest = kExtrapolationCameras};
    const reference::ReferenceBlending by_angle(rig, mesh, angle, kStep);
    for (int y = 0; y < kHeight; y += kStep)
      for (int x = 0; x < kWidth; x += kStep) {
        if (!is_beside(production, x, y)) continue;
        const std::vector<Real> expected = expected_weights(rig, mesh, view, plan.rays().at(x, y), by_angle.at(x, y));
        for (CameraIndex i = 0; i < rig.cameras.size(); i++) {
          const double weight = static_cast<double>(plan.blend()->weight(i, x, y)) / WeightGrid::kOne;
          worst = std::max(worst, std::abs(weight - static_cast<double>(expected[i])));
        }
        compared++;
      }
  }
  std::printf("%d points, worst weight error %.2g\n", compared, worst);
  EXPECT_GT(compared, 100);
  EXPECT_LE(worst, 2. / WeightGrid::kOne) << "rounding of two running sums";
}

TEST(Extrapolation, AllPixelsInFocusHaveTheWholeWeight) {
  for (int seed = 0; seed < 20; seed++) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const Rig rig = reference::random_rig(random);
    View view = reference::random_view(random, rig, kWidth, kHeight);
    view.blending = {};
    const Production production(rig, build_mesh(rig), view);
    std::vector<float> sum(static_cast<size_t>(kWidth) * kHeight);
    for (const auto& own : production.own_weights())
      for (size_t i = 0; i < sum.size(); i++) sum[i] += own.weight[i];
    for (int y = 0; y < kHeight; y++)
      for (int x = 0; x < kWidth; x++)
        ASSERT_NEAR(sum[static_cast<size_t>(y) * kWidth + x], production.owners.at(x, y) == FaceIdMap::kNone ? 0 : 1,
                    1e-4)
            << x << ", " << y;
  }
}

TEST(Extrapolation, PixelsInsideTheMeshStayTheSame) {
  int inside = 0, beside = 0;
  for (int seed = 0; seed < 20; seed++) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const Rig rig = reference::random_rig(random);
    const Mesh mesh = build_mesh(rig);
    View view = reference::random_view(random, rig, kWidth, kHeight);
    view.blending.extrapolates = false;
    const Production before(rig, mesh, view);
    EXPECT_EQ(before.plan.blend(), nullptr);
    view.blending.extrapolates = true;
    view.blending.fills_gaps = false;
    const Production now(rig, mesh, view);
    for (int y = 0; y < kHeight; y++)
      for (int x = 0; x < kWidth; x++) {
        if (before.owners.at(x, y) == FaceIdMap::kNone) {
          beside += is_beside(now, x, y);
          continue;
        }
        inside++;
        ASSERT_EQ(now.owners.at(x, y), before.owners.at(x, y));
        for (const CameraIndex camera : now.plan.faces()[now.owners.at(x, y)].camera)
          ASSERT_TRUE(camera == MeshFace::kNone || weight_at(now, camera, x, y) == weight_at(before, camera, x, y));
      }
  }
  EXPECT_GT(inside, 10000);
  EXPECT_GT(beside, 10000);
}

TEST(Extrapolation, CoveredViewHasNoGrid) {
  const Rig rig = reference::planar_grid(4, 4, 0.5);
  View view = view_from({0, 0, 0.001});
  EXPECT_EQ(ViewPlan(rig, build_mesh(rig), view).blend(), nullptr);
  view.pose.position.x = 2;
  EXPECT_NE(ViewPlan(rig, build_mesh(rig), view).blend(), nullptr);
}

// A view from in front of the array, through faces with cameras that see only the middle of the view.
class Gaps : public testing::Test {
 protected:
  Gaps() {
    rig_ = reference::planar_grid(4, 4, 0.5);
    mesh_ = build_mesh(rig_);
    view_ = view_from({0.03, -0.02, 0.4});
    view_.lens = Lens::from_fov_y(85, kWidth, kHeight);
    view_.focus.plane = focal_plane_at({}, 6);
  }
  View with_gaps() const {
    View view = view_;
    view.blending.fills_gaps = false;
    return view;
  }
  // The weight of the cameras that see the pixel.
  std::vector<float> seen(const Production& p) const { return view_coverage(rig_, p.plan, p.owners); }

  Rig rig_;
  Mesh mesh_;
  View view_;
};

TEST_F(Gaps, AreFilledIfOtherCamerasSeeThePoint) {
  const Production before(rig_, mesh_, with_gaps()), now(rig_, mesh_, view_);
  const std::vector<float> seen_before = seen(before), seen_now = seen(now);
  // The reference: a point can be seen if it is in the image of any camera.
  int empty_before = 0, empty_now = 0, visible = 0;
  for (int y = 0, i = 0; y < kHeight; y++)
    for (int x = 0; x < kWidth; x++, i++) {
      const LineOfSight line = line_of_sight(now.plan, Vec2(x, y));
      const Vec3 point = view_.pose.world_from_camera(line.focus * Vec3(line.ray, 1));
      const bool is_visible = std::ranges::any_of(rig_.cameras, [&](const Camera& camera) {
        const auto pixel = camera.lens.project(camera.pose.camera_from_world(point));
        return pixel && pixel->x >= 1 && pixel->y >= 1 && pixel->x <= camera.width - 2 && pixel->y <= camera.height - 2;
      });
      if (!is_visible) continue;
      visible++;
      empty_before += seen_before[i] <= 0;
      empty_now += seen_now[i] <= 0;
    }
  std::printf("%d of %d visible pixels were empty, and %d are\n", empty_before, visible, empty_now);
  EXPECT_GT(empty_before, 500);
  EXPECT_LT(empty_now, empty_before / 5) << "only pixels beside what any camera sees, within a cell";
}

TEST_F(Gaps, PixelsOfOtherCellsStayTheSame) {
  const Production before(rig_, mesh_, with_gaps()), now(rig_, mesh_, view_);
  const std::vector<float> seen_before = seen(before);
  int same = 0, filled = 0;
  for (int y = 0; y < kHeight; y++)
    for (int x = 0; x < kWidth; x++) {
      if (is_beside(now, x, y)) {
        // The renderer fills only cells with a corner in a gap.
        filled++;
        bool near_gap = false;
        for (const int j : {y / kStep * kStep, std::min(y / kStep * kStep + kStep, kHeight - 1)})
          for (const int i : {x / kStep * kStep, std::min(x / kStep * kStep + kStep, kWidth - 1)})
            near_gap = near_gap || seen_before[static_cast<size_t>(j) * kWidth + i] < 0.5f;
        ASSERT_TRUE(near_gap) << x << ", " << y;
        continue;
      }
      same++;
      ASSERT_EQ(now.owners.at(x, y), before.owners.at(x, y));
    }
  EXPECT_GT(same, 500);
  EXPECT_GT(filled, 500);
}

TEST_F(Gaps, WeightsFollowTheFormulaAtPoints) {
  const Production before(rig_, mesh_, with_gaps()), now(rig_, mesh_, view_);
  const ViewPlan& plan = now.plan;
  ASSERT_NE(plan.blend(), nullptr);
  View angle = view_;
  angle.blending = {.kind = Blending::Kind::kAngle, .nearest = kExtrapolationCameras};
  const reference::ReferenceBlending by_angle(rig_, mesh_, angle, kStep);
  double worst = 0;
  int compared = 0, faded = 0;
  for (int y = 0; y < kHeight; y += kStep)
    for (int x = 0; x < kWidth; x += kStep) {
      if (!is_beside(now, x, y)) continue;
      const std::vector<double> mesh_weights = weights_at(before, x, y);
      const LineOfSight line = line_of_sight(plan, Vec2(x, y));
      const Vec3 point = view_.pose.world_from_camera(line.focus * Vec3(line.ray, 1));
      double visible = 0;
      const std::vector<Real> nearest = by_angle.at(x, y);
      for (CameraIndex i = 0; i < rig_.cameras.size(); i++) {
        const Camera& camera = rig_.cameras[i];
        const auto pixel = camera.lens.project(camera.pose.camera_from_world(point));
        double part = 0;
        if (pixel)
          part = std::min({pixel->x + 0.5, pixel->y + 0.5, camera.width - 0.5 - pixel->x,
                           camera.height - 0.5 - pixel->y}) /
                 (0.05 * std::min(camera.width, camera.height));
        visible += mesh_weights[i] * std::clamp(40 * part, 0.0, 1.0);
      }
      const double t = std::min(visible / kEnoughVisibility, 1.0), share = 1 - t * t * (3 - 2 * t);
      faded += share > 0;
      for (CameraIndex i = 0; i < rig_.cameras.size(); i++)
        worst = std::max(worst, std::abs(static_cast<double>(plan.blend()->weight(i, x, y)) / WeightGrid::kOne -
                                         (share * static_cast<double>(nearest[i]) + (1 - share) * mesh_weights[i])));
      compared++;
    }
  std::printf("%d points, %d of them in gaps, worst weight error %.2g\n", compared, faded, worst);
  EXPECT_GT(compared, 8);
  EXPECT_GT(faded, 4);
  EXPECT_LE(worst, 2. / WeightGrid::kOne);
}

// Hosts render different regions of a view.
TEST_F(Gaps, OwnersDoNotDependOnTheRegion) {
  const Production whole(rig_, mesh_, view_);
  for (const Rect& region : {Rect{10, 3, 57, 44}, Rect{0, 40, kWidth, 41}, Rect{31, 0, 33, kHeight}}) {
    const FaceIdMap part(whole.plan, region);
    for (int y = region.y0; y < region.y1; y++)
      for (int x = region.x0; x < region.x1; x++) ASSERT_EQ(part.at(x, y), whole.owners.at(x, y)) << x << ", " << y;
  }
}

// Crosses the border pixel by pixel. Weights change at most a little faster than inside a triangle.
TEST(Extrapolation, IsContinuousAtTheBorder) {
  const Rig rig = reference::planar_grid(4, 4, 0.5);
  double inside = 0, across = 0, beside = 0;
  for (int n = 0; n < 40; n++) {
    // The border of the array, at x = 0.75, moves over the view.
    const View view = view_from({0.75 + 0.01 * n - 0.2, 0.03, -1.1});
    const Production production(rig, build_mesh(rig), view);
    ASSERT_NE(production.plan.blend(), nullptr);
    const int y = kHeight / 2;
    std::vector<double> last = weights_at(production, 0, y);
    for (int x = 1; x < kWidth; x++) {
      const std::vector<double> now = weights_at(production, x, y);
      double change = 0;
      for (size_t i = 0; i < now.size(); i++) change = std::max(change, std::abs(now[i] - last[i]));
      const int gridded = is_beside(production, x, y) + is_beside(production, x - 1, y);
      double& most = gridded == 0 ? inside : gridded == 1 ? across : beside;
      most = std::max(most, change);
      last = now;
    }
  }
  std::printf("largest change of a weight from pixel to pixel: %.3f inside, %.3f across the border, %.3f beside\n",
              inside, across, beside);
  EXPECT_LE(across, 0.25);
  EXPECT_LE(beside, 0.1);
}

// A row of cameras has strips, which reach to infinity above and below. Pixels beyond its ends are extrapolated.
TEST(Extrapolation, RowContinuesBeyondItsEnds) {
  Rig rig = reference::planar_grid(1, 5, 0.5);
  rig.topology = {};
  rig.topology.type = Topology::Type::kDelaunay;
  const View view = view_from({1.4, 0, -0.5});
  const Production production(rig, build_mesh(rig), view);
  ASSERT_NE(production.plan.blend(), nullptr);
  int beside = 0;
  for (int x = 0; x < kWidth; x++)
    for (int y = 0; y < kHeight; y++) {
      ASSERT_NE(production.owners.at(x, y), FaceIdMap::kNone);
      beside += is_beside(production, x, y);
    }
  EXPECT_GT(beside, 100);
}

// Cameras that get their homographies by command do not extrapolate: one homography covers one face.
TEST(Extrapolation, DoesNotAffectHomographies) {
  const Rig rig = reference::planar_grid(4, 4, 0.5);
  View view = view_from({2, 0, 0});
  view.blending.extrapolates = false;
  const ViewPlan plan(rig, build_mesh(rig), view);
  EXPECT_NO_THROW(validate(view_warp(rig, plan)));
}

}  // namespace
}  // namespace lf
