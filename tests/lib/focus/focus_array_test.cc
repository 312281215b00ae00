// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/focus_array.h"

#include "base/text.h"
#include "scene/scene.h"
#include "support/rigs.h"
#include "support/test.h"

namespace lf {
namespace {

TEST(ArrayPlane, IsThroughTheMeanPositionAndNormalToTheMeanAxis) {
  Rig rig = scene_rig(3, 5);
  for (Camera& camera : rig.cameras) camera.pose.position += Vec3(1e6, 2e6, -3e6);
  const Plane plane = array_plane(rig);
  EXPECT_NEAR(glm::length(plane.normal - Vec3(0, 0, 1)), 0, 1e-12);
  EXPECT_NEAR(plane.signed_distance({1e6, 2e6, -3e6}), 0, 1e-9);
  EXPECT_NEAR(plane.signed_distance({1e6 + 7, 2e6, -3e6 + 2}), 2, 1e-9) << "distances grow forwards";
}

TEST(ArrayPlane, UsesTheFirstCameraIfAxesCancel) {
  Rig rig = scene_rig(1, 2);
  rig.cameras[1].pose.orientation = glm::angleAxis(M_PI, Vec3(0, 1, 0));
  EXPECT_NEAR(array_plane(rig).normal.z, 1, 1e-12);
}

constexpr int kSide = 4;  // cameras

// An array in the plane z = 0 and a view from behind with a focal map.
struct Array {
  Rig rig = scene_rig(kSide, kSide, 160, 120);
  FocusArray array{rig};
  double pitch = rig.cameras[1].pose.position.x - rig.cameras[0].pose.position.x;

  View view_from(const Vec3& eye, double fov = 15) const {
    return {160,
            120,
            Lens::from_fov_y(fov, 160, 120),
            {eye},
            {plane_through({0, 0, 3}, {0, 0, -1}), test::level_surface(160, 120, 0.1, 1, 7)}};
  }

  // 1 - sum w^2, relative to three equal weights, where the line of sight of node i, j meets the cameras' plane. A
  // camera's weight is a six-sided hat: cells are split along the diagonal from the second to the third corner.
  double squared(const View& view, double i, double j) const {
    const Vec3 d(*view.lens.unproject({4 * i + 1.5, 4 * j + 1.5}), 1);
    const Vec3 eye = view.pose.position, p = eye - eye.z / d.z * d;
    double squares = 0, all = 0;
    for (const Camera& camera : rig.cameras) {
      const double x = (p.x - camera.pose.position.x) / pitch, y = (p.y - camera.pose.position.y) / pitch;
      const double w = std::max(0., 1 - std::max({std::abs(x), std::abs(y), std::abs(x + y)}));
      squares += w * w;
      all += w;
    }
    EXPECT_NEAR(all, 1, 1e-9) << "the array covers the view";
    return (1 - squares) / (2 / 3.);
  }
};

TEST(FocusArray, EvidenceFollowsFromTheWeights) {
  const Array a;
  for (const Vec3& eye : {Vec3(0, 0, -0.2), Vec3(0.007, -0.011, -0.15), Vec3(-0.013, 0.009, 0)}) {
    const View view = a.view_from(eye);
    const FocalMap& map = *view.focus.map;
    const std::vector<float> evidence = a.array.evidence(view, {});
    ASSERT_EQ(evidence.size(), map.levels.size());
    double least = 1, most = 0;
    for (int j = 0; j < map.rows; j++)
      for (int i = 0; i < map.columns; i++) {
        const double is = evidence[static_cast<size_t>(j) * map.columns + i];
        least = std::min(least, is);
        most = std::max(most, is);
        // Exact up to 24-bit weights at every fourth node, bilinear in between.
        const int x = i / FocusArray::kApart * FocusArray::kApart, y = j / FocusArray::kApart * FocusArray::kApart;
        const double u = (i - x) / 4., v = (j - y) / 4.;
        const auto at = [&](int k, int l) { return std::sqrt(a.squared(view, k, l)); };
        const double known =
            (1 - v) * ((1 - u) * at(x, y) + u * at(x + 4, y)) + v * ((1 - u) * at(x, y + 4) + u * at(x + 4, y + 4));
        ASSERT_NEAR(is, known, 2e-5) << i << ", " << j << " from " << eye.x;
        // A node at a camera, without evidence, takes the evidence of two nodes away.
        ASSERT_NEAR(is * is, a.squared(view, i, j), 0.35) << i << ", " << j;
      }
    if (eye.z < 0) {
      EXPECT_GT(most - least, 0.2) << "evidence varies";
    }
  }
}

TEST(FocusArray, OneCameraHasNoEvidenceAndThreeHaveMost) {
  const Array a;
  const Vec3 camera = a.rig.cameras[kSide + 1].pose.position;
  for (const float told : a.array.evidence(a.view_from(camera), {})) EXPECT_NEAR(told, 0, 1e-3);
  const Vec3 middle = camera + a.pitch / 3 * Vec3(1, 1, 0);
  for (const float told : a.array.evidence(a.view_from(middle), {})) EXPECT_NEAR(told, 1, 1e-6);
  const Vec3 edge = camera + a.pitch / 2 * Vec3(1, 0, 0);
  for (const float told : a.array.evidence(a.view_from(edge), {})) EXPECT_NEAR(told, std::sqrt(0.75), 1e-5);
}

TEST(FocusArray, NoEvidenceWithoutWeights) {
  const Array a;
  for (const float told : a.array.evidence(a.view_from({1, 0, 0}), {})) EXPECT_EQ(told, 0);
}

TEST(FocusArray, CamerasOutOfServiceHaveNoEvidence) {
  const Array a;
  CameraSet all_but_one;
  for (CameraIndex i = 0; i < a.rig.cameras.size(); i++)
    if (i != 5) all_but_one.push_back(i);
  for (const float told : a.array.evidence(a.view_from({0.003, 0.004, -0.2}), all_but_one)) EXPECT_NEAR(told, 0, 1e-3);
  EXPECT_THROW(a.array.evidence(a.view_from({}), {99}), Error);
  // A view from a lost camera's position uses the evidence of its neighbours.
  const View view = a.view_from(a.rig.cameras[5].pose.position);
  for (const float told : a.array.evidence(view, {5})) EXPECT_GT(told, 0.5);
}

TEST(FocusArray, ComputesTheResolution) {
  const Array a;
  const double focal = a.rig.cameras[0].lens.fx();
  EXPECT_TRUE(a.array.is_known());
  EXPECT_NEAR(a.array.spacing(), a.pitch, 1e-12);
  EXPECT_DOUBLE_EQ(a.array.focal(), focal);
  EXPECT_NEAR(a.array.disparity(), a.pitch * focal, 1e-9);
  // At this distance a camera's field of view is four pitches wide.
  EXPECT_NEAR(160 / focal / a.array.nearest(), 4 * a.pitch, 1e-12);
  // A point is at the centre of one image and half-way to the edge of its neighbour's.
  EXPECT_NEAR(a.array.disparity() * a.array.nearest(), 40, 1e-9);
}

TEST(FocusArray, UsesMedians) {
  Rig rig = scene_rig(1, 5, 160, 120);
  const double pitch = rig.cameras[1].pose.position.x - rig.cameras[0].pose.position.x;
  const double focal = rig.cameras[0].lens.fx();
  rig.cameras[4].pose.position.x += 100;
  rig.cameras[0].lens = Lens::pinhole(5000, 79.5, 59.5);
  EXPECT_NEAR(FocusArray(rig).disparity(), pitch * focal, 1e-9);
  EXPECT_NEAR(FocusArray(rig).nearest(), 160 / focal / 4 / pitch, 1e-9);
}

// In irregular arrays, triangle edges are longer than the distance to the nearest camera.
TEST(FocusArray, IrregularArraysUseTriangleEdges) {
  Rig rig = scene_rig(4, 4, 160, 120);
  const double pitch = rig.cameras[1].pose.position.x - rig.cameras[0].pose.position.x;
  for (size_t i = 1; i < rig.cameras.size(); i += 2) rig.cameras[i].pose.position.x -= 0.8 * pitch;
  const double spacing = FocusArray(rig).spacing(), focal = rig.cameras[0].lens.fx();
  EXPECT_NEAR(spacing, 0.2 * pitch, 1e-9);
  EXPECT_DOUBLE_EQ(FocusArray(rig).edge(), spacing) << "cells of a grid are alike";
  rig.topology = {Topology::Type::kDelaunay, 0, 0, {}};
  const FocusArray array(rig);
  EXPECT_DOUBLE_EQ(array.spacing(), spacing);
  EXPECT_GT(array.edge(), 0.9 * pitch);
  EXPECT_LT(array.edge(), 2 * pitch);
  EXPECT_DOUBLE_EQ(array.disparity(), array.edge() * focal);
  const Mesh mesh = build_mesh(rig);
  EXPECT_DOUBLE_EQ(FocusArray(rig, &mesh).edge(), array.edge());
}

TEST(FocusArray, EvidenceOfBlendingByAngle) {
  const Array a;
  View view = a.view_from({1, 0, 0});
  view.blending = {Blending::Kind::kAngle, 0, 4};
  for (const float told : a.array.evidence(view, {})) EXPECT_GT(told, 0.3);
  const Vec3 camera = a.rig.cameras[kSide + 1].pose.position;
  view = a.view_from(camera);
  view.blending = {Blending::Kind::kAngle, 0, 4};
  const std::vector<float> at_camera = a.array.evidence(view, {});
  EXPECT_NEAR(at_camera[at_camera.size() / 2], 0, 0.05);
  for (const float told : a.array.evidence(view, {kSide + 1})) EXPECT_GT(told, 0.5);
}

// A blurred picture has a larger disparity, the farther the viewpoint is from its cameras.
TEST(FocusArray, ViewpointsOutsideTheArrayHaveAWideBaseline) {
  const Array a;
  View view = a.view_from({a.pitch / 2, a.pitch / 2, -0.3});
  const double beside = a.array.width_of(view, {});
  EXPECT_GT(beside, a.pitch) << "the view is wider than the array";
  view.blending.extrapolates = false;
  EXPECT_DOUBLE_EQ(a.array.width_of(view, {}), a.pitch);
  view.blending.extrapolates = true;
  view.pose.position.x += 5 * a.pitch;
  EXPECT_GT(a.array.width_of(view, {}), beside + 4 * a.pitch);
  view.pose.position.x -= 5 * a.pitch;
  view.blending = {Blending::Kind::kAngle, 0, 4};
  EXPECT_NEAR(a.array.width_of(view, {}), 2 * std::sqrt(0.5) * a.pitch, 0.8 * a.pitch);
  const double inside = a.array.width_of(view, {});
  view.pose.position.x += 5 * a.pitch;
  EXPECT_GT(a.array.width_of(view, {}), inside + 4 * a.pitch);
  EXPECT_EQ(FocusArray(Plane{{0, 0, 1}, 0.5}).width_of(view, {}), 0);
}

TEST(FocusArray, CoincidentCamerasResolveNoDepth) {
  Rig rig = scene_rig(1, 2, 160, 120);
  rig.cameras[1].pose.position = rig.cameras[0].pose.position;
  for (const Rig& together : {rig, scene_rig(1, 1, 160, 120)}) {
    const FocusArray array(together);
    EXPECT_TRUE(array.is_known());
    EXPECT_EQ(array.disparity(), 0);
    EXPECT_EQ(array.nearest(), 0);
  }
}

TEST(FocusArray, WithoutARigEvidenceIsOne) {
  const FocusArray array = Plane{{0, 0, 1}, 0.5};
  EXPECT_FALSE(array.is_known());
  EXPECT_EQ(array.from(), (Plane{{0, 0, 1}, 0.5}));
  EXPECT_EQ(array.nearest(), 0);
  EXPECT_EQ(array.disparity(), 0);
  const View view = Array().view_from({});
  EXPECT_EQ(array.evidence(view, {}), std::vector<float>(view.focus.map->levels.size(), 1));
}

}  // namespace

}  // namespace lf
