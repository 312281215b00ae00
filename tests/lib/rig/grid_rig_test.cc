// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/grid_rig.h"

#include <functional>

#include <gtest/gtest.h>

#include "rig/rig_json.h"
#include "support/expect_error.h"

namespace lf {
namespace {

const GridRigOptions kGood = {2, 3, 0.1, 90, 640, 480};

TEST(GridRig, StandsAroundTheOriginRowByRowFromTheTop) {
  const Rig rig = make_grid_rig(kGood);
  ASSERT_EQ(rig.cameras.size(), 6u);
  EXPECT_EQ(rig.topology.type, Topology::Type::kGrid);
  EXPECT_EQ(rig.topology.rows, 2);
  EXPECT_EQ(rig.topology.columns, 3);
  EXPECT_NEAR(glm::length(rig.cameras[0].pose.position - Vec3(-0.1, -0.05, 0)), 0, 1e-15);
  EXPECT_NEAR(glm::length(rig.cameras[1].pose.position - Vec3(0, -0.05, 0)), 0, 1e-15);
  EXPECT_NEAR(glm::length(rig.cameras[3].pose.position - Vec3(-0.1, 0.05, 0)), 0, 1e-15);
  EXPECT_EQ(rig.cameras[5].name, "cam_01_02");
  EXPECT_EQ(rig.cameras[5].id, 5u);
  const Lens& lens = rig.cameras[5].lens;
  EXPECT_EQ(lens.model(), LensModel::kRadial);
  EXPECT_NEAR(lens.fx(), 240, 1e-12) << "90 degrees of height";
  EXPECT_EQ(lens.cx(), 319.5);
  EXPECT_EQ(lens.cy(), 239.5);
  EXPECT_EQ(parse_rig(rig_to_json(rig), "r.json").hash(), rig.hash());
}

TEST(GridRig, FromOneCameraOfOnePixelToTheLimits) {
  EXPECT_EQ(make_grid_rig({1, 1, 1, 60, 1, 1}).cameras[0].pose.position, Vec3(0, 0, 0));
  EXPECT_EQ(make_grid_rig({1, 1, 1e-6, 60, 8192, 8192}).cameras[0].width, 8192);
  EXPECT_EQ(make_grid_rig({255, 257, 1, 60, 4, 4}).cameras.size(), kMaxCameras);
}

TEST(GridRig, RefusesByName) {
  const std::pair<const char*, std::function<void(GridRigOptions&)>> cases[] = {
      {"rows: must be 1 to 65535, is 0", [](auto& o) { o.rows = 0; }},
      {"columns: must be 1 to 65535, is -1", [](auto& o) { o.columns = -1; }},
      {"rows x columns: at most 65535 cameras", [](auto& o) { o.rows = o.columns = 256; }},
      {"width: must be 1 to 16384, is 0", [](auto& o) { o.width = 0; }},
      {"height: must be 1 to 16384, is 16385", [](auto& o) { o.height = 16385; }},
      {"pitch: must be positive", [](auto& o) { o.pitch = 0; }},
      {"pitch: must be positive", [](auto& o) { o.pitch = std::nan(""); }},
      {"pitch: must be positive", [](auto& o) { o.pitch = INFINITY; }},
      {"fov_y: must be between 0 and 180 degrees", [](auto& o) { o.fov_y_deg = 180; }},
  };
  for (const auto& [message, spoil] : cases) {
    GridRigOptions options = kGood;
    spoil(options);
    EXPECT_ERROR(make_grid_rig(options), message);
  }
}

}  // namespace
}  // namespace lf
