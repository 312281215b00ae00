// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/mesh_fit.h"

#include <random>

#include <gtest/gtest.h>

#include "rig/array_shapes.h"

namespace lf {
namespace {

// As another program's file would bring it: without a topology.
Rig without_topology(Rig rig) {
  rig.topology = {};
  return rig;
}

Rig inward(int rows, int columns) { return make_cylinder_rig({rows, columns, 0.3, 1.5, true, 60}); }

// Cameras on a dome that look at its middle.
Rig dome(int cameras, double least_height) {
  Rig rig = make_grid_rig({1, cameras, 1, 60});
  rig.topology = {};
  std::mt19937 random(3);
  std::uniform_real_distribution<double> number(0, 1);
  for (Camera& camera : rig.cameras) {
    const double up = least_height + (1 - least_height) * number(random), turn = 2 * M_PI * number(random);
    const double across = std::sqrt(1 - up * up);
    const Vec3 at(across * std::cos(turn), -up, across * std::sin(turn));
    camera.pose = look_at(2.0 * at, Vec3(0), Vec3(0, 1, 0));
  }
  return rig;
}

TEST(MeshFit, ALevelRingGetsTheTrianglesAroundIt) {
  for (const bool inwards : {true, false}) {
    const Rig ring = make_cylinder_rig({2, 12, 0.3, 1.5, inwards, 60});
    Rig found = without_topology(ring);
    EXPECT_LT(share_looked_through(found, build_mesh(found)), 0.5) << "Delaunay goes across the middle";
    const std::vector<std::string> notes = fit_topology(found);
    ASSERT_EQ(notes.size(), 1u);
    EXPECT_NE(notes[0].find(inwards ? "look at it" : "look away from it"), std::string::npos) << notes[0];
    ASSERT_EQ(found.topology.type, Topology::Type::kTriangles);
    EXPECT_EQ(found.topology.triangles.size(), ring.topology.triangles.size()) << "none at the open ends";
    EXPECT_EQ(share_looked_through(found, build_mesh(found)), 1);
    for (const auto& t : found.topology.triangles)
      for (int k = 0; k < 3; k++)
        EXPECT_LT(glm::length(found.cameras[t[k]].pose.position - found.cameras[t[(k + 1) % 3]].pose.position), 1);
  }
}

TEST(MeshFit, ADomeStaysWhole) {
  // A cap is flat enough for the plane; cameras all around and above are not.
  Rig cap = dome(60, 0.7);
  EXPECT_TRUE(fit_topology(cap).empty());
  EXPECT_EQ(cap.topology.type, Topology::Type::kDelaunay);
  Rig sphere = dome(200, -1);
  ASSERT_EQ(fit_topology(sphere).size(), 1u);
  EXPECT_EQ(share_looked_through(sphere, build_mesh(sphere)), 1);
  EXPECT_EQ(sphere.topology.triangles.size(), 2 * 200u - 4) << "Euler: a closed mesh";
}

TEST(MeshFit, ARowStaysARow) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> jitter(-0.002, 0.002);
  Rig arc = make_arc_rig({9, 0.2, 1, 60}), line = make_grid_rig({1, 9, 0.2, 60});
  for (Rig* rig : {&arc, &line}) {
    rig->topology = {};
    for (Camera& camera : rig->cameras) camera.pose.position.y += jitter(random);
    ASSERT_EQ(fit_topology(*rig).size(), 1u);
    const Mesh mesh = build_mesh(*rig);
    ASSERT_EQ(mesh.faces.size(), 8u);
    for (const MeshFace& face : mesh.faces) EXPECT_EQ(face.corners(), 2);
  }
}

TEST(MeshFit, WhatSuitsIsLeftAlone) {
  Rig grid = without_topology(make_grid_rig({4, 5, 0.1, 60}));
  EXPECT_TRUE(fit_topology(grid).empty());
  EXPECT_EQ(grid.topology.type, Topology::Type::kDelaunay);
  Rig cylinder = inward(2, 12);
  const size_t triangles = cylinder.topology.triangles.size();
  EXPECT_TRUE(fit_topology(cylinder).empty()) << "it has a topology";
  EXPECT_EQ(cylinder.topology.triangles.size(), triangles);
  for (int cameras : {1, 2}) {
    Rig few = without_topology(make_grid_rig({1, cameras, 0.1, 60}));
    EXPECT_TRUE(fit_topology(few).empty());
  }
}

TEST(MeshFit, SaysSoWhereNothingSuits) {
  Rig ring = inward(2, 12);
  ring.cameras.resize(12);  // the upper row alone
  ring.topology = {};
  const std::vector<std::string> notes = fit_topology(ring);
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_NE(notes[0].find("two rows"), std::string::npos) << notes[0];
}

TEST(MeshFit, StrangePlacesAreNoFault) {
  Rig far = without_topology(make_grid_rig({2, 3, 0.1, 60}));
  for (size_t i = 0; i < far.cameras.size(); i++) far.cameras[i].pose.position *= i % 2 ? 1e300 : 1e-300;
  fit_topology(far);
  Rig one_place = without_topology(make_grid_rig({2, 3, 0.1, 60}));
  for (Camera& camera : one_place.cameras) camera.pose.position = Vec3(1, 2, 3);
  EXPECT_TRUE(fit_topology(one_place).empty());
}

TEST(GridFault, NamesCamerasInTheWrongOrder) {
  Rig rig = make_grid_rig({4, 4, 0.1, 60});
  EXPECT_FALSE(find_grid_fault(rig));
  EXPECT_FALSE(find_grid_fault(make_grid_rig({1, 5, 0.1, 60})));
  EXPECT_FALSE(find_grid_fault(without_topology(rig)));
  Rig turned = rig;  // column by column: a grid all the same
  for (int row = 0; row < 4; row++)
    for (int column = 0; column < 4; column++)
      turned.cameras[row * 4 + column].pose = rig.cameras[column * 4 + row].pose;
  EXPECT_FALSE(find_grid_fault(turned));

  std::swap(rig.cameras[5].pose, rig.cameras[10].pose);
  const auto fault = find_grid_fault(rig);
  ASSERT_TRUE(fault);
  EXPECT_EQ(fault->triangles, 18u);
  EXPECT_GT(fault->folded, 0u);
  EXPECT_NE(fault->text.find("cam_0"), std::string::npos) << fault->text;

  Rig wrong_shape = make_grid_rig({2, 8, 0.1, 60});
  wrong_shape.topology.rows = wrong_shape.topology.columns = 4;
  EXPECT_TRUE(find_grid_fault(wrong_shape));
  Rig line = make_grid_rig({1, 4, 0.1, 60});
  line.topology.rows = line.topology.columns = 2;
  EXPECT_TRUE(find_grid_fault(line));
}

}  // namespace
}  // namespace lf
